# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium, driven over the WebDriver protocol, with its requests and its console."""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html.parser import HTMLParser
import json
from pathlib import Path
import re
import shutil
import subprocess
import tempfile
from typing import Any
from urllib.request import Request, urlopen

import pytest

CHROMIUM = shutil.which('chromium') or shutil.which('chromium-browser') \
    or shutil.which('google-chrome')
DRIVER = shutil.which('chromedriver')


def needs_browser(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test that looks at a page as readers do, and skip it where nothing shows it."""
    skip = pytest.mark.skipif(not (CHROMIUM and DRIVER),
                              reason='chromium and chromedriver are not installed')
    marked: Callable[..., None] = pytest.mark.browser(skip(test))
    return marked


_ARGUMENTS = ['--headless=new', '--no-sandbox', '--disable-gpu', '--disable-quic',
              '--no-first-run', '--disable-background-networking', '--disable-component-update',
              '--disable-sync', '--hide-scrollbars', '--disable-dev-shm-usage']

# Two boxes of text that overlap by more than a pixel; what is not shown has no box.
OVERLAPS = """
    const found = [];
    for (const svg of document.querySelectorAll('svg.chart')) {
      if (!svg.getBoundingClientRect().width) continue;
      const place = svg.getBoundingClientRect();
      const texts = [...svg.querySelectorAll('text')].map(item =>
        [item.textContent, item.getBoundingClientRect()]).filter(([, box]) => box.width);
      texts.forEach(([text, box], i) => {
        if (box.left < place.left - 1 || box.right > place.right + 1 ||
            box.top < place.top - 1 || box.bottom > place.bottom + 1)
          found.push('outside: ' + text);
        for (const [other, next] of texts.slice(i + 1)) {
          if (Math.min(box.right, next.right) - Math.max(box.left, next.left) > 1 &&
              Math.min(box.bottom, next.bottom) - Math.max(box.top, next.top) > 3)
            found.push(text + ' | ' + other);
        }
      });
    }
    return found;"""
# Text whose colour is less than 4.5 to 1 from the nearest paper behind it (WCAG 2.1, AA).
FAINT = """
    const parts = colour => colour.match(/[\\d.]+/g).map(Number);
    const light = colour => parts(colour).slice(0, 3).map(c => c / 255).map(c =>
      c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4).reduce((sum, c, i) =>
      sum + c * [0.2126, 0.7152, 0.0722][i], 0);
    const paper = item => {
      for (let at = item; at; at = at.parentElement) {
        const colour = getComputedStyle(at).backgroundColor;
        if (parts(colour).length === 3 || parts(colour)[3] > 0.5) return colour;
      }
      return 'rgb(255, 255, 255)';
    };
    const found = [];
    for (const item of document.querySelectorAll('main *')) {
      const own = [...item.childNodes].some(n => n.nodeType === 3 && n.textContent.trim());
      if (!own || !item.getBoundingClientRect().width || item.tagName === 'title') continue;
      const style = getComputedStyle(item);
      const ink = light(item instanceof SVGElement ? style.fill : style.color);
      const back = light(paper(item));
      const ratio = (Math.max(ink, back) + 0.05) / (Math.min(ink, back) + 0.05);
      if (ratio < 4.5) found.push([item.textContent.slice(0, 40), ratio]);
    }
    return found;"""


class Outline(HTMLParser):
    """Visible text, tags and scripts of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.scripts: list[str] = []
        self.inside = ''
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag in ('script', 'style'):
            self.inside = tag
            self.scripts += [''] if tag == 'script' else []

    def handle_endtag(self, tag: str) -> None:
        self.inside = '' if tag == self.inside else self.inside

    def handle_data(self, data: str) -> None:
        if self.inside == 'script':
            self.scripts[-1] += data
        elif not self.inside:
            self.words.append(' '.join(data.split()))

    @property
    def text(self) -> str:
        return ' '.join(' '.join(self.words).split())


class Browser:
    def __init__(self, address: str) -> None:
        self._address = address

    def call(self, path: str, body: dict[str, Any] | None = None, method: str = '') -> Any:
        request = Request(self._address + path, method=method or ('POST' if body else 'GET'),
                          data=json.dumps(body).encode() if body else None,
                          headers={'Content-Type': 'application/json'})
        with urlopen(request, timeout=60) as answer:
            return json.load(answer)['value']

    def cdp(self, command: str, **parameters: Any) -> Any:
        return self.call('/goog/cdp/execute', {'cmd': command, 'params': parameters})

    def show(self, page: Path, *, width: int = 1200, height: int = 900, dark: bool = False,
             phone: bool = False) -> None:
        """Show a report; its pictures are part of it and need no waiting for."""
        self.cdp('Emulation.setDeviceMetricsOverride', width=width, height=height,
                 deviceScaleFactor=1, mobile=phone)
        self.cdp('Emulation.setEmulatedMedia', features=[
            {'name': 'prefers-color-scheme', 'value': 'dark' if dark else 'light'}])
        self.call('/url', {'url': page.resolve().as_uri()})

    def run(self, script: str) -> Any:
        return self.call('/execute/sync', {'script': script, 'args': []})

    def console(self) -> list[str]:
        """Return what was written to the console since the last question."""
        return [entry['message'] for entry in self.call('/se/log', {'type': 'browser'})]

    def requests(self) -> list[str]:
        """Return the addresses that were asked for since the last question."""
        events = [json.loads(entry['message'])['message']
                  for entry in self.call('/se/log', {'type': 'performance'})]
        return [event['params']['request']['url'] for event in events
                if event['method'] == 'Network.requestWillBeSent']


def faults_of(page: Path, browser: Browser, width: int, dark: bool) -> list[Any]:
    """Return what cannot be read on a page, with everything opened that can be."""
    browser.show(page, width=width, phone=width < 600, dark=dark)
    browser.run('for (const item of document.querySelectorAll("details")) item.open = true;')
    wide = browser.run('return document.documentElement.scrollWidth')
    found: list[Any] = [f'{wide} px wide'] if wide > width else []
    return found + browser.run(OVERLAPS) + browser.run(FAINT)


@contextmanager
def running_browser() -> Iterator[Browser]:
    """Start a browser with a profile of its own; it ends with the context."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, subprocess.Popen(
            [DRIVER, '--port=0'], stdout=subprocess.PIPE, text=True) as driver:
        try:
            started = next(line for line in driver.stdout or () if ' successfully on port' in line)
            address = f'http://127.0.0.1:{started.split()[-1].rstrip(".")}/session'
            options = {'binary': CHROMIUM, 'args': [*_ARGUMENTS, f'--user-data-dir={profile}']}
            session = Browser(address).call('', {'capabilities': {'alwaysMatch': {
                'browserName': 'chrome', 'goog:chromeOptions': options,
                'goog:loggingPrefs': {'browser': 'ALL', 'performance': 'ALL'}}}})
            browser = Browser(f'{address}/{session["sessionId"]}')
            yield browser
            browser.call('', method='DELETE')
        finally:
            driver.terminate()


def pages_in_print(page: Path, browser: Browser) -> list[tuple[float, ...]]:
    """Give the sizes of the pages that a printer would get of a page looked at in the dark."""
    browser.show(page, dark=True)
    data = b64decode(browser.cdp('Page.printToPDF', preferCSSPageSize=True)['data'])
    return [tuple(map(float, size.split()))
            for size in re.findall(rb'/MediaBox\s*\[0 0 ([\d. ]+)\]', data)]
