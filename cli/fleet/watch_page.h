#pragma once

namespace alidade::fleet {

/// The page of `fleet watch`: asks /fleet.json every two seconds, and /camera/ID.json of the camera that is chosen.
inline constexpr const char* watch_page =
    R"(<!doctype html><html lang="en"><head><meta charset="utf-8"><title>fleet</title>
<meta name="viewport" content="width=device-width,initial-scale=1"><style>
body{font:14px/1.4 system-ui,sans-serif;margin:1em;color:#222;background:#fff}h1{font-size:1.2em;margin:0 0 .5em}
#map{display:flex;flex-wrap:wrap;gap:2px;margin:.6em 0;max-height:14em;overflow:auto}
#map button{width:11px;height:11px;padding:0;border:0;border-radius:2px;cursor:pointer}
.good{background:#2e7d32}.care{background:#f9a825}.bad{background:#c62828}.refused{background:#90a4ae}.not_converged{background:#6d4c41}
table{border-collapse:collapse}td,th{padding:.15em .7em;text-align:right;border-bottom:1px solid #eee}
td:first-child,td:last-child,th:first-child,th:last-child{text-align:left}tr{cursor:pointer}svg{border:1px solid #ddd;display:block;margin:.3em 0}
</style></head><body><h1>Fleet</h1><div id="sum" role="status"></div><div id="map" aria-label="a cell a camera, by its verdict"></div>
<div id="one"></div><h2 style="font-size:1em">The worst first</h2><table><thead><tr><th>camera</th><th>n</th><th>t [s]</th><th>fx [px]</th>
<th>zero of pan [°]</th><th>zero of tilt [°]</th><th>alarms</th><th></th></tr></thead><tbody id="rows"></tbody></table><script>
const $=id=>document.getElementById(id),deg=180/Math.PI;let chosen='';
const pm=(v,s,k,d)=>v===null||v===undefined?'–':(k*v).toFixed(d)+' ± '+(k*s).toFixed(d);
const cell=(row,text)=>{const td=document.createElement('td');td.textContent=text;row.append(td)};
function line(points,name,k){const ys=points.map(p=>p[name]).filter(v=>v!==null).map(v=>k*v);if(ys.length<2)return'';
const lo=Math.min(...ys),hi=Math.max(...ys),w=600,h=90,y=v=>h-8-(h-16)*(hi>lo?(v-lo)/(hi-lo):.5);
return`<div>${name}: ${lo.toPrecision(6)} to ${hi.toPrecision(6)}</div><svg width="${w}" height="${h}" role="img" aria-label="${name}"><polyline fill="none" stroke="#1565c0" points="${ys.map((v,i)=>(w*i/(ys.length-1)).toFixed(1)+','+y(v).toFixed(1)).join(' ')}"/></svg>`}
async function one(){if(!chosen)return;const c=await(await fetch('/camera/'+encodeURIComponent(chosen)+'.json')).json();
$('one').innerHTML='<h2 style="font-size:1em"></h2>'+line(c.history,'pan_zero_rad',deg)+line(c.history,'tilt_zero_rad',deg)+line(c.history,'fx',1)+'<ul></ul>';
$('one').querySelector('h2').textContent=chosen+': '+c.sentence+' (zeros in °)';
for(const a of c.alarms.slice().reverse()){const li=document.createElement('li');li.textContent=a;$('one').querySelector('ul').append(li)}}
async function all(){try{const f=await(await fetch('/fleet.json')).json();
$('sum').textContent=`${f.cameras} cameras, ${f.alarms} alarms; `+Object.entries(f.verdicts).map(([k,v])=>`${v} ${k}`).join(', ');
$('map').replaceChildren(...f.map.map(([id,state])=>{const b=document.createElement('button');b.className=state;b.title=id+': '+state;b.onclick=()=>{chosen=id;one()};return b}));
$('rows').replaceChildren(...f.worst.map(c=>{const r=document.createElement('tr');r.onclick=()=>{chosen=c.camera;one()};
cell(r,c.camera);cell(r,c.n);cell(r,c.t===null?'':c.t.toFixed(1));cell(r,pm(c.estimate.fx,c.stddev.fx,1,2));cell(r,pm(c.estimate.pan_zero_rad,c.stddev.pan_zero_rad,deg,3));
cell(r,pm(c.estimate.tilt_zero_rad,c.stddev.tilt_zero_rad,deg,3));cell(r,c.alarms);cell(r,c.verdict.state+': '+c.verdict.sentence);return r}));await one()}
catch(e){$('sum').textContent='no answer: '+e.message}setTimeout(all,2000)}all();
</script></body></html>
)";

}  // namespace alidade::fleet
