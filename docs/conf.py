# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Sphinx: `make docs` builds the pages into docs/_build/html, warnings are errors."""

from importlib.util import find_spec

project = 'imu_allan'
copyright = '2026, The imu_allan authors'  # noqa: A001
author = 'The imu_allan authors'
release = '0.1.0'

extensions = [
    'myst_parser',
    'sphinx.ext.autodoc',
    'sphinx.ext.napoleon',
    # Formulas are drawn by a MathJax that lies beside the pages, so that they show offline. The
    # build farm of ROS lacks it: there the browser fetches one.
    *(name for name in ('sphinx-mathjax-offline',) if find_spec(name)),
]
myst_enable_extensions = ['dollarmath', 'deflist']
# Options begin with two hyphens, and stay so.
smartquotes = False
myst_heading_anchors = 3
exclude_patterns = ['_build']

# The build farm of ROS has its own theme only.
html_theme = 'furo' if find_spec('furo') else 'sphinx_rtd_theme'
html_title = 'imu_allan'
html_static_path = ['_static']
html_css_files = ['tables.css']

autodoc_typehints = 'none'
napoleon_google_docstring = False
napoleon_use_rtype = False
# Types in docstrings are for readers; they are not all names that can be linked to.
nitpick_ignore_regex = [('py:.*', '.*')]
