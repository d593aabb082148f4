#pragma once

namespace alidade::fleet {

/// The page of `fleet watch`: asks /fleet.json every two seconds, and /camera/ID.json of the camera that is chosen.
inline constexpr const char* watch_page =
    R"page(<!doctype html><html lang="en"><head><meta charset="utf-8"><title>alidade fleet</title><link rel="icon" href="data:,">
<meta name="viewport" content="width=device-width,initial-scale=1"><style>
:root{color-scheme:light dark;--ink:#1d2329;--soft:#5b6570;--line:#d9dee3;--ground:#f4f6f8;--card:#fff;--blue:#0065a3;--good:#1b7f5c;--care:#8a6100;--bad:#b3261e;--refused:#5b6570;--not_converged:#7b4bb5}
@media(prefers-color-scheme:dark){:root{--ink:#e6eaee;--soft:#a3adb8;--line:#39424b;--ground:#15191d;--card:#1e2429;--blue:#6cb4ee;--good:#5fc9a0;--care:#e9b949;--bad:#ff8a80;--refused:#a3adb8;--not_converged:#c9a4f5}}
body{font:14px/1.45 system-ui,"DejaVu Sans",sans-serif;margin:0;color:var(--ink);background:var(--ground)}
header,section{background:var(--card);border:1px solid var(--line);border-radius:6px;margin:10px;padding:10px 14px}
h1{font-size:1.15em;margin:0}h2{font-size:1em;margin:0 0 .4em}p{margin:.2em 0;color:var(--soft)}
.two{display:grid;grid-template-columns:minmax(20em,2fr) 3fr}@media(max-width:900px){.two{grid-template-columns:100%}}
#map{display:flex;flex-wrap:wrap;gap:1px;max-height:26em;overflow:auto;align-content:flex-start}
#map button{font:12px/15px "DejaVu Sans",sans-serif;width:16px;height:16px;padding:0;border:1px solid transparent;background:none;cursor:pointer}
#map button[aria-pressed=true],#map button:focus-visible{border-color:var(--ink);outline:none}
#map .good,span.good{color:var(--good)}#map .care,span.care{color:var(--care)}#map .bad,span.bad{color:var(--bad)}
#map .refused,span.refused{color:var(--refused)}#map .not_converged,span.not_converged{color:var(--not_converged)}
.scroll{overflow:auto;max-height:30em}table{border-collapse:collapse;width:100%}td,th{padding:.15em .6em;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}
td:first-child,th:first-child,td:last-child,th:last-child{text-align:left}td:last-child{white-space:normal}
#rows tr{cursor:pointer}#rows tr:focus-visible,#rows tr.chosen{outline:2px solid var(--blue);outline-offset:-2px}
figure{margin:.5em 0 0}figcaption{font-size:12.5px;font-weight:600}svg{width:100%;display:block}svg text{font-size:11px;fill:var(--soft)}
#alarms{max-height:11em;overflow:auto;margin:.4em 0 0;padding-left:1.2em}input{font:inherit;padding:.1em .4em;width:11em;float:right}
</style></head><body>
<header><h1 id="sum" role="status">The fleet …</h1><p id="counts"></p></header>
<div class="two"><section><input id="find" placeholder="find a camera" aria-label="find a camera by its name" autocomplete="off"><h2>Which cameras need a look?</h2>
<p>One mark per camera, the worst first: ▲ bad, ✕ lost, ◆ care, ■ not learned yet, ● good</p><div id="map"></div></section>
<section id="one"><h2>History of a camera</h2><p>Choose one in the map or in the table.</p></section></div>
<section><h2>The worst first</h2><div class="scroll"><table><thead><tr><th>camera</th><th>row</th><th>t [s]</th><th>fx [px]</th><th>zero of pan [°]</th>
<th>zero of tilt [°]</th><th>alarms</th><th>verdict</th></tr></thead><tbody id="rows"></tbody></table></div><p>Values ± 3σ; zeros against those at the start. Not moved: no change has been detected.</p></section>
)page"
    R"page(<script>
const $=id=>document.getElementById(id),deg=180/Math.PI,mark={good:'●',care:'◆',bad:'▲',refused:'■',not_converged:'✕'};
let chosen='',drawn='',last=null;
const el=(tag,more={},...inner)=>{const made=document.createElement(tag);Object.entries(more).forEach(([k,v])=>made.setAttribute(k,v));made.append(...inner);return made};
const isNumber=v=>typeof v==='number'&&isFinite(v);
const pm=(v,s,k)=>{if(!isNumber(v))return'–';if(v===0&&s===0)return'not moved';const three=3*k*s,d=isNumber(s)&&s>0?Math.min(6,Math.max(0,1-Math.floor(Math.log10(three)))):3;return(k*v).toFixed(d)+(isNumber(s)?' ± '+three.toFixed(d):'')};
const clock=t=>t>1e9?new Date(1000*t).toLocaleString():t.toFixed(1)+' s';
function ticks(lo,hi,n){const raw=(hi-lo)/n,p=10**Math.floor(Math.log10(raw)),m=raw/p,step=(m<=1?1:m<=2?2:m<=5?5:10)*p,all=[];
for(let v=Math.ceil(lo/step)*step;v<=hi+1e-9*step&&all.length<20;v+=step)all.push(+v.toPrecision(12));return all}
function figure(c,name,words,k){const h=c.history.filter(p=>isNumber(p[name]));if(h.length<2)return'';
const W=Math.max(320,$('one').clientWidth-28),H=112,l=62,r=8,t=8,b=22,sigma='sigma_'+name,of=p=>isNumber(p[sigma])?3*k*p[sigma]:0;
const ys=h.flatMap(p=>[k*p[name]-of(p),k*p[name]+of(p)]),t0=h[0].t,t1=h[h.length-1].t;let lo=Math.min(...ys),hi=Math.max(...ys);const pad=.06*(hi-lo)||1e-3;lo-=pad;hi+=pad;
const x=v=>l+(W-l-r)*(v-t0)/((t1-t0)||1),y=v=>t+(H-t-b)*(hi-v)/(hi-lo),f=v=>v.toFixed(1);
const band=[...h.map(p=>[x(p.t),y(k*p[name]+of(p))]),...h.slice().reverse().map(p=>[x(p.t),y(k*p[name]-of(p))])].map(([a,d])=>f(a)+','+f(d)).join(' ');
const yt=ticks(lo,hi,3).map(v=>`<line x1="${l}" x2="${W-r}" y1="${f(y(v))}" y2="${f(y(v))}" stroke="var(--line)"/><text x="${l-5}" y="${f(y(v)+4)}" text-anchor="end">${+v.toPrecision(9)}</text>`).join('');
const xt=ticks(t0,t1,5).map(v=>`<text x="${f(x(v))}" y="${H-6}" text-anchor="middle">${t0>1e9?new Date(1000*v).toLocaleTimeString():+v.toPrecision(8)+' s'}</text>`).join('');
const at=c.alarms.filter(a=>isNumber(a.t)&&a.t>=t0&&a.t<=t1).map(a=>`<line x1="${f(x(a.t))}" x2="${f(x(a.t))}" y1="${t}" y2="${H-b}" stroke="var(--bad)" stroke-dasharray="4 3"/><text x="${f(x(a.t))}" y="${t+6}" text-anchor="middle" style="fill:var(--bad)">▼</text>`).join('');
const now=h[h.length-1];return`<figure><figcaption>${words}</figcaption><svg viewBox="0 0 ${W} ${H}" role="img" aria-label="${words}: now ${pm(now[name],now[sigma],k)}">${yt}${xt}<polygon points="${band}" fill="var(--blue)" opacity=".22"/><polyline fill="none" stroke="var(--blue)" stroke-width="1.6" points="${h.map(p=>f(x(p.t))+','+f(y(k*p[name]))).join(' ')}"/>${at}</svg></figure>`}
async function one(){if(!chosen)return;const id=chosen,answer=await fetch('/camera/'+encodeURIComponent(id)+'.json');if(!answer.ok||id!==chosen)return;
const c=await answer.json(),s=c.state.verdict.state,made=el('div');
made.innerHTML=figure(c,'pan_zero_rad','Zero of pan, ° (band: ± 3σ; ▼ alarm)',deg)+figure(c,'tilt_zero_rad','Zero of tilt, °',deg)+figure(c,'fx','Focal length fx, px',1)||'<p>There is no history yet.</p>';
$('one').replaceChildren(el('h2',{},el('span',{class:s},(mark[s]||'')+' '),id+': '+c.sentence),made,el('h2',{},c.alarms.length?'What it said, the last first':'No alarm'),
el('ul',{id:'alarms'},...c.alarms.slice().reverse().map(a=>el('li',{},a.sentence+' (row '+a.n+(isNumber(a.t)?', '+clock(a.t):'')+')'))))}
function choose(id){chosen=id;for(const b of $('map').children)b.setAttribute('aria-pressed',String(b.dataset.id===id));
for(const r of $('rows').children)r.classList.toggle('chosen',r.dataset.id===id);one().catch(()=>{})}
function map(cells){const text=$('find').value.toLowerCase(),shown=text?cells.filter(([id])=>id.toLowerCase().includes(text)):cells,key=JSON.stringify(shown);if(key===drawn)return;drawn=key;
$('map').replaceChildren(...shown.map(([id,state,alarms])=>{const words=id+': '+state.replace('_',' ')+(alarms?', alarms: '+alarms:'');
return el('button',{class:state,title:words,'aria-label':words,'aria-pressed':String(id===chosen),'data-id':id},mark[state]||'?')}))}
$('map').onclick=event=>{const id=event.target.dataset.id;if(id)choose(id)};
function row(c){const r=el('tr',{'data-id':c.camera,tabindex:'0',class:c.camera===chosen?'chosen':''}),s=c.verdict.state;
r.onclick=()=>choose(c.camera);r.onkeydown=event=>{if(event.key==='Enter')choose(c.camera)};
for(const text of[c.camera,c.n,isNumber(c.t)?c.t.toFixed(1):'',pm(c.estimate.fx,c.stddev.fx,1),pm(c.estimate.pan_zero_rad,c.stddev.pan_zero_rad,deg),pm(c.estimate.tilt_zero_rad,c.stddev.tilt_zero_rad,deg),c.alarms])r.append(el('td',{},String(text)));
r.append(el('td',{},el('span',{class:s},(mark[s]||'')+' '),c.verdict.sentence));return r}
function show(f){last=f;const v=f.verdicts,ask=(v.bad||0)+(v.not_converged||0)+(v.care||0);
$('sum').textContent=f.cameras===0?'No camera has been seen yet':ask===0?`None of ${f.cameras} cameras needs a look`:`${ask} of ${f.cameras} cameras need${ask===1?'s':''} a look`;
$('counts').textContent=Object.entries(v).map(([k,n])=>`${mark[k]||''} ${n} ${k==='refused'?'not learned yet':k.replace('_',' ')}`).join(' · ')+` · ${f.alarms} alarm${f.alarms===1?'':'s'}`;map(f.map);
const focus=document.activeElement?.closest?.('#rows tr')?.dataset.id;$('rows').replaceChildren(...f.worst.map(row));
if(focus)[...$('rows').children].find(r=>r.dataset.id===focus)?.focus();if(!chosen&&f.worst.length)choose(f.worst[0].camera)}
$('find').oninput=()=>last&&map(last.map);
async function all(){try{const answer=await fetch('/fleet.json');show(await answer.json());await one()}catch(error){$('sum').textContent='No answer: is fleet watch still running?'}setTimeout(all,2000)}
all();
</script></body></html>
)page";

}  // namespace alidade::fleet
