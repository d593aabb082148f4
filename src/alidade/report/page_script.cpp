#include "alidade/report/page_frame.h"

namespace alidade::report {

std::string_view page_script() {
  return R"js(
(() => {
  const root = document.documentElement, all = (query) => [...document.querySelectorAll(query)];
  const result = () => document.getElementById('result').textContent;
  const save = (name, text, type) => {
    const link = document.createElement('a');
    link.href = URL.createObjectURL(new Blob([text], {type}));
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };
  const toggleTheme = () => {
    const isDark = root.dataset.theme ? root.dataset.theme === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
    root.dataset.theme = isDark ? 'light' : 'dark';
  };
  const csv = (table) => {
    const names = Object.keys(table).filter((name) => Array.isArray(table[name]));
    const word = (v) => v === null || v === undefined ? '' : /[",\n]/.test(v) ? '"' + String(v).replace(/"/g, '""') + '"' : v;
    const rows = (table[names[0]] || []).map((_, i) => names.map((name) => word(table[name][i])).join(','));
    return [names.join(','), ...rows].join('\n') + '\n';
  };
  const order = all('.thumb').map((thumb) => thumb.dataset.photo);
  let chosen = (document.querySelector('.thumb.chosen') || {dataset: {}}).dataset.photo;
  const choose = (photo) => {
    const thumb = document.querySelector('.thumb[data-photo="' + photo + '"]');
    if (!thumb) return;
    chosen = photo;
    all('.pick').forEach((mark) => mark.classList.toggle('chosen', mark.dataset.photo === photo));
    all('.board.chosen').forEach((board) => board.parentNode.append(board));
    for (const part of ['picture', 'marks'])
      all('use[data-part=' + part + ']').forEach((use) => use.setAttribute('href', '#' + part + '-' + photo));
    all('[data-part=caption]').forEach((caption) => { caption.textContent = thumb.dataset.caption; });
    all('svg.stage').forEach((stage) => stage.setAttribute('aria-label', thumb.dataset.label || 'Residual arrows in the photo ' + thumb.dataset.caption));
  };
  const step = (by) => order.length && choose(order[(order.indexOf(chosen) + by + order.length) % order.length]);
  document.getElementById('theme').onclick = toggleTheme;
  document.getElementById('download').onclick = () => save('result.json', result(), 'application/json');
  document.addEventListener('click', (event) => {
    const mark = event.target.closest('.pick'), table = event.target.closest('[data-csv]');
    if (mark) choose(mark.dataset.photo);
    if (table) save(table.dataset.csv + '.csv', csv(JSON.parse(result()).data[table.dataset.csv]), 'text/csv');
  });
  document.addEventListener('change', (event) => {
    if (event.target.name !== 'trust') return;
    all('#fig-trust .choice').forEach((map) => { map.hidden = map.dataset.choice !== event.target.value; });
  });
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === 'INPUT') return;
    const keys = {ArrowRight: () => step(1), j: () => step(1), ArrowLeft: () => step(-1), k: () => step(-1), d: toggleTheme};
    if (keys[event.key]) keys[event.key]();
  });
})();
)js";
}

}  // namespace alidade::report
