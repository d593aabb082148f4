// Bundles the page into one file: node build.mjs [OUTPUT]. The library fills in title, document and pictures.
import {readFileSync, writeFileSync} from 'node:fs';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';
import {build} from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const output = process.argv[2] ?? join(here, 'report.template.html');

async function bundled(entry) {
  const made = await build({
    absWorkingDir: here,
    entryPoints: [entry],
    bundle: true,
    minify: true,
    write: false,
    format: 'iife',
    target: 'es2021',
    charset: 'utf8',
    legalComments: 'none',  // the notices stand in the template's head
    logLevel: 'warning',
  });
  return made.outputFiles[0].text;
}

// A package that brings no notice has it here.
const notices = {'@foxglove/ws-protocol': 'src/licences/foxglove-ws-protocol.txt'};
const licences = ['three', 'uplot', '@foxglove/ws-protocol', 'eventemitter3']
  .map((name) => {
    const folder = join(here, 'node_modules', name);
    const {version} = JSON.parse(readFileSync(join(folder, 'package.json'), 'utf8'));
    const notice = name in notices ? join(here, notices[name]) : join(folder, 'LICENSE');
    return `${name} ${version}\n${readFileSync(notice, 'utf8').trim()}`;
  })
  .join('\n\n')
  .replace(/--/g, '–');  // would end the comment

const [script, style] = await Promise.all([bundled('src/main.ts'), bundled('src/style.css')]);
// Functions as replacements: '$&' in a bundle is not a pattern.
const page = readFileSync(join(here, 'src/template.html'), 'utf8')
  .replace('/*STYLE*/', () => style.trim())
  .replace('LICENCES', () => licences)
  .replace('/*SCRIPT*/', () => script.trim().replace(/<\/(script)/gi, '<\\/$1').replace(/<!--/g, '<\\!--'));
writeFileSync(output, page);
