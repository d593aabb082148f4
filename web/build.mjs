// Bundles the page into one file: node build.mjs [OUTPUT]. The library fills in title, document and pictures.
import {readFileSync, writeFileSync} from 'node:fs';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';
import {build} from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const output = process.argv[2] ?? join(here, 'report.template.html');

// Half of three's shaders is light and shadow, which no figure has: what these two materials and the lines do not include
// is left empty. A seventh of a report's size.
const shadersOf = ['meshbasic_vert', 'meshbasic_frag', 'points_vert', 'points_frag'];
const includesIn = (text) => [...text.matchAll(/#include <(\w+)>/g)].map((match) => match[1]);

function withoutLight(module, lines) {
  const texts = new Map([...module.matchAll(/^(?:var|const) ([\w$]+) = ("(?:[^"\\\n]|\\.)*");$/gm)].map(([, name, text]) => [name, text]));
  const table = /^const ShaderChunk = \{\n([^}]*)\n\};$/m.exec(module);
  if (!table) throw new Error('three.module.js has no table of shaders any more: see build.mjs');
  const nameOf = new Map([...table[1].matchAll(/(\w+): ([\w$]+)/g)].map(([, chunk, name]) => [chunk, name]));
  const used = new Set();
  const use = (chunk) => {
    if (!nameOf.has(chunk)) throw new Error(`three has no shader ${chunk} any more: see build.mjs`);
    if (used.has(nameOf.get(chunk))) return;
    used.add(nameOf.get(chunk));
    includesIn(texts.get(nameOf.get(chunk))).forEach(use);
  };
  const always = [...module.matchAll(/ShaderChunk\[ '(\w+)' \]/g)].map((match) => match[1]);  // in every program
  [...shadersOf, ...includesIn(lines), ...always].forEach(use);
  const unused = [...nameOf.values()].filter((name) => !used.has(name));
  return unused.reduce((text, name) => text.replace(`${name} = ${texts.get(name)};`, () => `${name} = "";`), module);
}

const shaders = {
  name: 'shaders',
  setup(build) {
    build.onLoad({filter: /three\.module\.js$/}, ({path}) => {
      const lines = join(dirname(path), '../examples/jsm/lines/LineMaterial.js');
      return {contents: withoutLight(readFileSync(path, 'utf8'), readFileSync(lines, 'utf8'))};
    });
  },
};

async function bundled(entry) {
  const made = await build({
    absWorkingDir: here,
    entryPoints: [entry],
    bundle: true,
    plugins: [shaders],
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
