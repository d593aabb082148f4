// Makes pages as the library does, opens them in a browser, and watches for what must not happen.
import {existsSync, mkdtempSync, readFileSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';
import {chromium} from 'playwright-core';

export const chromiumPath = process.env.CHROMIUM ?? '/usr/bin/chromium';
export const folder = mkdtempSync(join(tmpdir(), 'alidade-pages-'));

const escaped = (text) => text.replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/>/g, '&gt;').replace(/"/g, '&quot;');

/** The same steps as report/page.cpp. `images`: {name: bytes of a JPEG}. */
export function pageText(template, json, images = {}) {
  const blocks = Object.entries(images).map(([name, bytes], i) =>
    `<script type="text/plain" id="image-${i}" data-name="${escaped(name)}">${Buffer.from(bytes).toString('base64')}</script>`);
  return template.replace('@TITLE@', () => 'alidade').replace('@RESULT@', () => json.replace(/</g, '\\u003c')).replace('@PICTURES@', () => blocks.join('\n'));
}

let made = 0;
export function pageFile(template, document, images = {}) {
  const file = join(folder, `page-${++made}.html`);
  writeFileSync(file, pageText(template, typeof document === 'string' ? document : JSON.stringify(document), images));
  return pathToFileURL(file).href;
}

export function readJson(file) {
  return JSON.parse(readFileSync(file, 'utf8'));
}

export function hasBrowser() {
  return existsSync(chromiumPath);
}

export async function launch(more = []) {
  return chromium.launch({executablePath: chromiumPath, headless: true, args: ['--headless', '--no-sandbox', '--disable-gpu', ...more]});
}

/** A page whose console, errors and requests are kept in `faults`. */
export async function opened(browser, url, {width = 1280, height = 900, theme = 'light', script = null} = {}) {
  const context = await browser.newContext({viewport: {width, height}, colorScheme: theme});
  const page = await context.newPage();
  page.setDefaultTimeout(120_000); // a machine may be busy with other things
  const faults = [];
  page.on('console', (message) => message.type() === 'error' && faults.push(`console: ${message.text()}`));
  page.on('pageerror', (error) => faults.push(`error: ${error.message}`));
  page.on('request', (request) => {
    if (!/^(file|data|blob):/.test(request.url())) faults.push(`request: ${request.url()}`);
  });
  if (script) await page.addInitScript(script);
  const show = async (address) => {
    await page.goto(address);
    if (address !== 'about:blank') await page.waitForFunction(() => document.documentElement.dataset.ready === '1');
  };
  await show(url);
  return {page, faults, show, close: () => context.close()};
}

/** Draws all 3-D figures, also those far from the window, and waits for two frames; `whole`: scrolls through the page, for thumbnails are decoded in sight. */
export async function settled(page, {whole = false} = {}) {
  await page.evaluate(async (all) => {
    for (const view of window.alidade.views3 ?? []) view.wake();
    for (let y = 0; all && y < document.body.scrollHeight; y += 600) {
      scrollTo(0, y);
      await new Promise((done) => requestAnimationFrame(done));
    }
    scrollTo(0, 0);
    for (let i = 0; i < 3; ++i) await new Promise((done) => requestAnimationFrame(() => setTimeout(done, 20)));
  }, whole);
}
