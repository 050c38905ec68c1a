# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Sphinx: `make docs` builds the pages into docs/_build/html, warnings are errors."""

from pathlib import Path
import re

project = 'imu_allan'
copyright = '2026, The imu_allan authors'  # noqa: A001
author = 'The imu_allan authors'
release = re.search(r'<version>(.*)</version>',
                    (Path(__file__).parents[1] / 'package.xml').read_text())[1]

extensions = [
    'myst_parser',
    'sphinx.ext.autodoc',
    'sphinx.ext.napoleon',
]
myst_enable_extensions = ['dollarmath', 'deflist']
myst_heading_anchors = 3
exclude_patterns = ['_build']

html_theme = 'furo'
html_title = 'imu_allan'
html_static_path = ['_static']
html_css_files = ['tables.css']

autodoc_typehints = 'none'
napoleon_google_docstring = False
napoleon_use_rtype = False
# Types in docstrings are for readers; they are not all names that can be linked to.
nitpick_ignore_regex = [('py:.*', '.*')]
