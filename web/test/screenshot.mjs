// A report as a browser shows it, 3-D figures too, for the docs: node screenshot.mjs REPORT.html OUT.png WIDTHxHEIGHT SCALE
import {resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import {launch, settled} from './page.mjs';

const [report, out, size, scale] = process.argv.slice(2), [width, height] = size.split('x').map(Number);
const browser = await launch();
const page = await browser.newPage({viewport: {width, height}, deviceScaleFactor: Number(scale), colorScheme: 'light'});
await page.goto(pathToFileURL(resolve(report)).href);
await page.waitForFunction(() => document.documentElement.dataset.ready === '1');
await settled(page, {whole: true});
await page.screenshot({path: out});
await browser.close();
