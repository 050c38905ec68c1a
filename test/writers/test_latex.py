# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
import re
import shutil
import subprocess

from imu_allan.writers.latex import BIBLIOGRAPHY, noise_table
import pytest


def test_the_table_has_every_observable_term_with_its_interval_or_bound(result):
    rows = [line.strip() for line in noise_table(result).splitlines() if line.startswith('    $')]
    assert rows[0] == (r'$N$ angle random walk & $^\circ/\sqrt{\mathrm{h}}$ & '
                       r'2.406 [2.402, 2.411] & 2.647 [2.642, 2.652] & 2.286 [2.282, 2.291] \\')
    assert rows[2] == (r'$K$ rate random walk & $^\circ/\mathrm{h}/\sqrt{\mathrm{h}}$ & '
                       r'50 [35, 64] & 54 [38, 71] & $< 23.5$ \\')
    assert len(rows) == 6


def test_every_brace_is_closed_every_citation_known_and_the_settings_are_there(result):
    text = noise_table(result)
    assert text.count('{') == text.count('}')
    assert all(line.count('&') == 4 for line in text.splitlines() if line.startswith('    $'))
    cited = set(re.findall(r'\\cite\{(\w+)\}', text))
    assert cited == set(re.findall(r'@\w+\{(\w+),', BIBLIOGRAPHY))
    assert all(re.search(r'^  author = \{', entry, re.MULTILINE)
               for entry in BIBLIOGRAPHY.split('\n\n'))
    method = ' '.join(text.split())
    assert ('from 3 h of samples at 200\\,Hz of the sensor at rest, of which 5 min 45 s of motion '
            'were left out.') in method
    assert 'Narrow lines in the spectrum of gyro\\_z were left out of the fit.' in method


@pytest.mark.slow
@pytest.mark.skipif(not (shutil.which('pdflatex') and shutil.which('bibtex')
                         and shutil.which('kpsewhich')
                         and subprocess.run(['kpsewhich', 'booktabs.sty'], check=False,
                                            stdout=subprocess.DEVNULL).returncode == 0),
                    reason='no LaTeX with booktabs is installed')
def test_the_table_is_typeset_without_a_complaint(result, tmp_path):
    (tmp_path / 'imu_noise.tex').write_text(noise_table(result))
    (tmp_path / 'imu_noise.bib').write_text(BIBLIOGRAPHY)
    (tmp_path / 'paper.tex').write_text(
        '\\documentclass{article}\\usepackage[margin=2cm]{geometry}\\usepackage{booktabs}'
        '\\begin{document}\\input{imu_noise}\\bibliographystyle{plain}'
        '\\bibliography{imu_noise}\\end{document}')

    def run(*command):
        return subprocess.run(command, cwd=tmp_path, check=True, capture_output=True,
                              text=True).stdout

    latex = 'pdflatex', '-interaction=nonstopmode', '-halt-on-error', 'paper'
    run(*latex)
    assert 'Warning' not in run('bibtex', 'paper')
    run(*latex)
    said = run(*latex)
    assert 'Warning' not in said
    assert 'Overfull' not in said
