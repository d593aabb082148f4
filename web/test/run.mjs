// The report pages in a real browser: node run.mjs TEMPLATE [ALIDADE]. Exit code 77: skipped, there is no browser.
import {existsSync, readFileSync, rmSync} from 'node:fs';
import {resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import {calibrateDocument, localizeDocument, movingDocument, reproduceDocument, servoDocument} from './documents.mjs';
import {chromiumPath, folder, hasBrowser, launch, opened, pageFile} from './page.mjs';
import {realResults} from './runs.mjs';
import * as answers from './answers.mjs';
import * as behaviour from './behaviour.mjs';
import * as capture from './capture.mjs';
import * as captureReal from './capture_real.mjs';
import * as live from './live.mjs';
import * as trouble from './trouble.mjs';

// only: tests whose names hold this; !this: that do not; several, by commas. What measures time has "timed:" before its name.
const [templateFile, givenAlidade, only = ''] = process.argv.slice(2), words = only.split(',').filter(Boolean);
const alidade = givenAlidade && resolve(givenAlidade); // it is run in other folders
if (!hasBrowser()) {
  console.log(`web: skipped, there is no ${chromiumPath} (CHROMIUM names another)`);
  process.exit(77);
}
const template = readFileSync(templateFile, 'utf8'), started = Date.now();
const documents = {servo: {document: servoDocument()}, localize: {document: localizeDocument()}, reproduce: {document: reproduceDocument()}, 'rig, moving target': {document: movingDocument()}};
const hasAlidade = Boolean(alidade && existsSync(alidade));
const hasAll = words.every((word) => word.startsWith('!'));
if (hasAlidade && hasAll) Object.assign(documents, realResults(alidade));
else if (hasAll) console.log('web: without the executable only made-up documents are shown');

const browser = await launch(), failures = [];
const context = {
  browser, template, documents, alidade,
  url: (document, images) => pageFile(template, document, images),
  urlOf: (name) => (documents[name].report ? pathToFileURL(documents[name].report).href : pageFile(template, documents[name].document)),
  open: (url, options) => opened(browser, url, options),
  calibration: calibrateDocument,
};
async function test(title, body) {
  const name = body.isTimed ? `timed: ${title}` : title;
  if (!words.every((word) => (word.startsWith('!') ? !name.includes(word.slice(1)) : name.includes(word)))) return;
  const start = Date.now();
  try {
    await body(context);
    console.log(`ok    ${name} (${((Date.now() - start) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failures.push(name);
    console.log(`FAILS ${name}: ${error.message}`);
  }
}
for (const name of Object.keys(documents)) await test(`${name}: opens, draws all, in both themes and widths`, (c) => behaviour.opensAndDraws(c, name));
for (const module of [answers, behaviour, trouble, ...(hasAlidade ? [live, capture, captureReal] : [])]) for (const [name, body] of Object.entries(module.tests)) if (!body.needs || documents[body.needs]) await test(name, body);
await browser.close();
rmSync(folder, {recursive: true, force: true});
console.log(`web: ${failures.length === 0 ? 'all tests pass' : `${failures.length} tests fail: ${failures.join('; ')}`} (${((Date.now() - started) / 1000).toFixed(0)} s, ${(template.length / 1000).toFixed(0)} kB template)`);
process.exit(failures.length === 0 ? 0 : 1);
