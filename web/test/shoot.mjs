// Images of pages, to be looked at: node shoot.mjs TEMPLATE OUT [WIDTHS [THEMES]] RESULT.json[:PHOTOS]...
import {mkdirSync, readdirSync, readFileSync} from 'node:fs';
import {join} from 'node:path';
import {launch, opened, pageFile, settled} from './page.mjs';

const [template, out, widths, themes, ...results] = process.argv.slice(2);
mkdirSync(out, {recursive: true});
const text = readFileSync(template, 'utf8'), browser = await launch();
for (const result of results) {
  const [file, photos] = result.split(':'), images = {};
  if (photos) for (const name of readdirSync(photos)) if (/\.jpe?g$/.test(name)) images[name] = readFileSync(join(photos, name));
  const url = pageFile(text, readFileSync(file, 'utf8'), images), name = file.split('/').at(-2) ?? 'page';
  for (const width of widths.split(','))
    for (const theme of themes.split(',')) {
      const {page, faults, close} = await opened(browser, url, {width: Number(width), theme});
      await settled(page, {whole: true});
      await page.screenshot({path: join(out, `${name}-${width}-${theme}.png`), fullPage: true});
      const failed = await page.evaluate(() => document.querySelector('[data-failed]')?.textContent ?? '');
      console.log(name, width, theme, faults.length ? faults : 'ok', failed);
      await close();
    }
}
await browser.close();
