# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The pages are in plain English: short sentences, the field's terms, and a glossary of them."""

import ast
from pathlib import Path
from pydoc_data.topics import topics
import re

from imu_allan.finding import Finding
from imu_allan.finding_messages import explained, title_of
from imu_allan.finding_texts import WORDS
import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / name for name in ('README.md', 'CONTRIBUTING.md', 'CHANGELOG.rst')] + sorted(
    ROOT.glob('docs/*.md'))
LONGEST = 25
ENDS = r'(?<=[.!?])[*)"]*\s+'
"""Neither a colon nor a semicolon ends a sentence."""
ORDINARY = tuple((ROOT / 'test' / 'ordinary_words.txt').read_text().split())
"""Of everyday English, or names of products, formats and units; no term of statistics."""
PRIVATE = re.compile(
    r'\b(told|doubt\w*|borne out|stick(s|ing)? out|stand(s|ing)? in for|bridg\w+|stretch(es)?|'
    r'stands? out|coast\w*|claim\w*|band-limited|course of|courses of the mean|a word of|'
    r'laid to|wild|bent|wander|'
    r'(?<!random )(?<!Random )walks?)\b', re.IGNORECASE)
"""English of our own, for which the field has terms."""
INTERNAL = re.compile(
    r'told|doubt|borne.out|sticks?.?out|(?<!Brownian )bridg|stretch|claim|'
    r'(?<![a-z])pieces?(?![a-z])|\b(alike|laid|(?<!of )courses?)\b', re.IGNORECASE)
"""The same in names and comments."""
TERMS_OF_ART = (
    'Allan deviation', 'bias instability', 'flicker', 'Gauss-Markov', 'high-pass', 'interval',
    'knock', 'low-pass', 'noise density', 'outlier', 'posterior', 'prior', 'quantization noise',
    'random walk', 'ramp', 'receive stamp', 'segment', 'spectrum', 'tone', 'turn-on bias',
    'unaided', 'upper bound', 'warm-up', 'white noise', 'NIS', 'NEES', 'Cramér-Rao', 'likelihood',
    'deterministic drift', 'in-run bias stability', 'evidence', 'coverage', 'degrees of freedom',
    'jitter', 'rms', 'aiding interval', 'averaging time', 'backtest', 'bias state', 'conservative',
    'correlation time', 'deadband', 'drift model', 'effective window', 'full model',
    'interpolated', 'overconfident', 'predicted variance', 'saturat', 'standard deviation',
    'time constant', 'variance')
GLOSSARY = (ROOT / 'docs' / 'glossary.md').read_text()


def paragraphs(text):
    """Yield the prose of a page: no code, no tables, no formulas in lines of their own."""
    for pattern in (r'^(`{3,}).*?^\1\s*$', r'^\$\$.*?^\$\$[^\n]*$'):
        text = re.sub(pattern, '\n', text, flags=re.MULTILINE | re.DOTALL)
    lines = []
    for line in [*text.splitlines(), '']:
        item = re.match(r'\s*([-*]|\d+\.) (.*)', line)
        if item or line.startswith(('|', '#')) or not line.strip():
            yield ' '.join(lines)
            lines = [item[2]] if item else []
            if line.startswith('#'):
                yield line.lstrip('# ')
        else:
            lines.append(line.strip())


def sentences(text):
    """Yield sentences without the code and the targets of links in them."""
    for paragraph in paragraphs(text):
        prose = re.sub(r'`[^`]*`', 'CODE', paragraph)
        prose = re.sub(r'\]\([^)]*\)', ']', re.sub(r'\$[^$]*\$', 'X', prose))
        yield from filter(None, re.split(ENDS, prose))


def words_of(text):
    """Count what holds a letter or a digit."""
    return sum(bool(re.search(r'\w', word)) for word in text.split())


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_sentences_of_a_page_are_short_and_have_no_english_of_its_own(page):
    prose = list(sentences(page.read_text()))
    assert not [sentence for sentence in prose if words_of(sentence) > LONGEST]
    prose += [re.sub(r'`[^`]*`', '', line) for line in page.read_text().splitlines()
              if line.startswith('|')]
    assert not [text for text in prose if PRIVATE.search(text)]


def shown_strings(path):
    """Yield the text of a module that a user may read: several words, 0 for a figure."""
    tree = ast.parse(path.read_text())
    nodes = list(ast.walk(tree))
    others = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    others |= {id(part) for node in nodes if isinstance(node, ast.JoinedStr)
               for part in node.values}
    for node in nodes:
        text = node.value if isinstance(node, ast.Constant) else ''.join(
            str(part.value) if isinstance(part, ast.Constant) else '0'
            for part in node.values) if isinstance(node, ast.JoinedStr) else None
        if isinstance(text, str) and id(node) not in others and ' ' in text.strip():
            yield text


def test_sentences_of_the_program_are_short_and_have_no_english_of_its_own():
    texts = [text for path in (ROOT / 'imu_allan').rglob('*.py') for text in shown_strings(path)]
    assert not [sentence for text in texts for sentence in re.split(ENDS, text)
                if words_of(sentence) > LONGEST
                and not re.match(r'\s*(SELECT|CREATE|PRAGMA|INSERT)\b', text)]
    texts += (ROOT / 'config' / 'imu_allan.yaml').read_text().splitlines()
    assert len(texts) > 1000
    # What an option or an argument is called.
    assert not [text for text in texts if PRIVATE.search(re.sub(r'\bcoast(_s)?\b', '', text))]


def test_no_name_or_comment_has_english_of_its_own():
    # These have the words to look for.
    lists = ('test_language.py', 'test_finding_messages.py')
    lines = [line for folder in ('imu_allan', 'test', 'bench')
             for path in (ROOT / folder).rglob('*.py') if path.name not in lists
             for line in path.read_text().splitlines()]
    assert len(lines) > 40_000
    assert not [line for line in lines if INTERNAL.search(line)]


def test_the_glossary_is_short_and_sorted_and_the_pages_are_no_longer_than_they_were():
    terms = re.findall(r'^- \*\*(.*?)\*\*', GLOSSARY, re.MULTILINE)
    assert 30 <= len(terms) <= 40
    assert terms == sorted(terms, key=str.lower)
    # Tables and code included; a bar between cells is no word.
    pages = [ROOT / 'README.md', *ROOT.glob('docs/*.md')]
    assert sum(words_of(page.read_text()) for page in pages) <= 18_000


def test_every_term_of_art_that_is_shown_is_in_the_glossary():
    shown = ' '.join([*(line for code in WORDS for line in explained(code)),
                      *(title_of(Finding(code)) for code in WORDS),
                      *(text for path in (ROOT / 'imu_allan').rglob('*.py')
                        for text in shown_strings(path)),
                      *(path.read_text() for path in ROOT.glob('imu_allan/**/*.html.j2')),
                      *(path.read_text() for path in PAGES if path.name != 'glossary.md')])
    used = {term for term in TERMS_OF_ART if re.search(rf'\b{term}', shown, re.IGNORECASE)}
    assert len(used) > 20
    assert not {term for term in used if not re.search(rf'\b{term}', GLOSSARY, re.IGNORECASE)}


def words_shown():
    """Return the words of screens, commands, node, findings and verdicts, in lower case."""
    texts = [text for part in ('.', 'cli', 'node', 'recordings', 'writers')
             for path in (ROOT / 'imu_allan' / part).glob('*.py') for text in shown_strings(path)
             if not re.search(r'[<\\]|^\s*(SELECT|CREATE|PRAGMA|INSERT)\b', text)]
    texts += [path.read_text() for path in ROOT.glob('test/writers/screens/*.txt')]
    texts += [line for code in WORDS for line in explained(code)]
    # Neither placeholders, paths, options and keys, nor file names.
    codes = r'%\(?\w*\)?\w|\{[^}]*\}|\S*[/_=~]\S*|--?\w[\w-]*|\S+\.\w+'
    return {word.lower() for text in texts
            for word in re.findall(r'[A-Za-z][a-z]+', re.sub(codes, '', text))}


def forms_of(word):
    """Return a word without its ending, and as it may stand in a list."""
    endings = (('s', ''), ('es', ''), ('ed', ''), ('d', ''), ('ing', ''), ('ing', 'e'), ('ly', ''),
               ('ies', 'y'), ('ied', 'y'), ('er', ''), ('st', ''), ('est', ''))
    return {word, f'{word}s', f'{word}ed', f'{word}e'} | {
        word.removesuffix(end) + other for end, other in endings if word.endswith(end)}


def test_a_word_that_the_program_shows_is_plain_or_in_the_glossary():
    shown = words_shown()
    assert len(shown) > 900
    manual = ' '.join(topics.values()).lower()
    known = {*re.findall('[a-z]+', manual + GLOSSARY.lower()), *ORDINARY}
    assert not {word for word in shown if not forms_of(word) & known}, (
        'say it in plain English, or explain it in docs/glossary.md')
    # The list of ordinary words does not grow: there is room for a few; terms are explained.
    assert list(ORDINARY) == sorted(set(ORDINARY))
    assert not set(ORDINARY) - set().union(*map(forms_of, shown))
    assert len(ORDINARY) <= 330
