# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Result files of strangers: used by every verb and writer, or refused in one line."""

from dataclasses import replace
from html.parser import HTMLParser
import io
import json
from random import Random
import xml.etree.ElementTree as ET

from characterized import streamed
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding
from imu_allan.result import GaussMarkov, PowerLaw, Span, Tone
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.filters import CONSUMERS
from imu_allan.writers.report import report_html
from imu_allan.writers.result_files import load_result
from imu_allan.writers.table import result_table
import mutations
from mutations import run_command
import pytest
from rich.console import Console
from whole_lines import refused

SPECIFICATION = ('name: Limits\ngyro: {noise_density: 0.3 deg/sqrt(h), rate_ramp: 1 deg/h^2}\n'
                 'accel: {noise_density: 150 ug/sqrt(Hz), bias_instability: 40 ug}\n')


def measured():
    """Characterize a minute of a simulated IMU; what it lacks of a long record is added."""
    result = streamed(simulated_blocks(
        parse_model(SPECIFICATION), 100.0, 6000, start_ns=10**18), 'a/b').result()
    axes = dict(result.axes)
    axes['gyro_x'] = replace(axes['gyro_x'], tones=(Tone(13.0, 1e-3), Tone(26.0, 1e-4)),
                             gauss_markov=GaussMarkov(1e-4, 30.0), band_limit_s=0.004,
                             power_law=PowerLaw(0.7, (0.6, 0.8), 1e-8))
    timeline = replace(result.timeline, gaps=(Span(10.0, 2.0),), motion=(Span(30.0, 1.0),))
    return replace(result, axes=axes, timeline=timeline,
                   warnings=(*result.warnings, Finding('motion', message='The IMU moved.')))


RESULT = measured()
DOCUMENT = RESULT.to_dict()
TEXT = RESULT.to_json()


class Judge:
    """Runs the verbs on one damaged result file."""

    def __init__(self, folder, share_drawn):
        self.share_drawn = share_drawn
        self.file, self.whole = folder / 'result.json', folder / 'whole.json'
        self.output, self.specification = folder / 'out', folder / 'limits.yaml'
        self.whole.write_text(TEXT)
        self.specification.write_text(SPECIFICATION)
        self.used = 0

    def __call__(self, content, choice):
        self.file.write_bytes(content)
        try:
            result = load_result(self.file)
        except ImuAllanError as error:
            # One verb shows how a refusal looks; all read the file by the same function.
            status, _ = run_command('check', self.file, '--spec', self.specification)
            assert status == 1
            assert str(error).isprintable() or '\n' not in str(error)
            return
        self.used += 1
        verdict, junit = self.output / 'v.json', self.output / 'v.xml'
        run_command('check', self.file, '--spec', self.specification, '--json', verdict,
                    '--junit', junit, statuses=(0, 1, 3, 4))
        if verdict.exists():
            json.loads(verdict.read_text(), parse_constant=pytest.fail)
            ET.parse(junit)
        for consumer in choice.sample(sorted(CONSUMERS), 3):
            run_command('export', self.file, '--for', consumer)
        HTMLParser().feed(report_html(result))
        console = Console(file=io.StringIO(), width=110)
        console.print(result_table(result, console.width))
        mutations.assert_harmless_on_a_terminal(console.file.getvalue())
        # Figures take seconds, nearly all of it the time of matplotlib.
        if choice.random() < self.share_drawn:
            for files, form in (((self.file,), 'svg'), ((self.whole, self.file), 'png')):
                run_command('report', *files, '--output', self.output, '--format', form)


def a_result(judge, choice):
    kind = choice.random()
    if kind < .75:
        document = mutations.mutated_document(DOCUMENT, choice, same_types=choice.random() < .8)
        judge(json.dumps(document).encode(), choice)
    elif kind < .9:
        text = mutations.mutated_text(TEXT, choice, ['"tau_s"', '[]', '{}', 'NaN', 'Infinity'])
        judge(text.encode(errors='surrogatepass'), choice)
    else:
        judge(mutations.mutated_bytes(TEXT.encode(), choice), choice)


@mutations.rounds(30)
def test_damaged_result_files_are_used_or_refused(tmp_path, count, seed):
    judge = Judge(tmp_path, .01)
    mutations.each(count, seed, lambda choice: a_result(judge, choice))
    assert judge.used >= count / 5


# Found by mutation: the square of a sample interval over 1e-200 s is no number any more; a quarter
# of the smallest number there is, is zero.
@pytest.mark.parametrize(('path', 'key', 'value'), [
    *((('axes', 'gyro_x'), 'gauss_markov', {'sigma': sigma, 'correlation_time_s': time_s})
      for sigma, time_s in ((1e-4, 5e-324), (1e-200, 1e59))),
    (('timeline',), 'sample_rate_hz', 5e-324)])
def test_what_is_absurd_is_drawn_or_refused_and_steers_no_terminal(tmp_path, path, key, value):
    document = RESULT.to_dict()
    changed = document
    for name in path:
        changed = changed[name]
    changed[key] = value
    Judge(tmp_path, 0.0)(json.dumps(document).encode(), Random(1))


def test_a_very_long_word_does_not_make_a_very_long_line(tmp_path):
    # Found by mutation: what was not understood stood in the message as a whole.
    document = RESULT.to_dict()
    document['source']['kind'] = 'a' * 100_000
    Judge(tmp_path, 0.0)(json.dumps(document).encode(), Random(1))
    with refused(f"{tmp_path}/result.json.source.kind: '{'a' * 98}…{'a' * 98}' is not one of "
                 'recording, topic, datasheet'):
        load_result(tmp_path / 'result.json')


@pytest.mark.parametrize('name', ['2/140', '3/487', '5/824'])
def test_a_value_far_outside_of_its_picture_is_drawn_or_refused(tmp_path, name):
    # Found by mutation: the pixel of a value 1e300 times the range is no number any more, and
    # the square of what a mean is uncertain by over 5e-324 s none either.
    a_result(Judge(tmp_path, 0.0), Random(name))
