#include <fmt/format.h>

#include "alidade/report/colours.h"
#include "alidade/report/page_frame.h"

namespace alidade::report {
namespace {

constexpr std::string_view light_colours =
    "color-scheme:light;--bg:#f3f5f7;--card:#fff;--ink:#15191e;--muted:#525d6a;--line:#dde2e8;--panel:#eef1f4;"
    "--good:#00704e;--care:#855600;--bad:#b3330f;--refused:#6a3d9a;--blue:#0072b2;--orange:#a66300;--green:#007a58;";
constexpr std::string_view dark_colours =
    "color-scheme:dark;--bg:#0e1115;--card:#171b21;--ink:#e8ebef;--muted:#a3adb9;--line:#2d343d;--panel:#20262e;"
    "--good:#43c99b;--care:#e2a63c;--bad:#ff8562;--refused:#c6a5f0;--blue:#4fb0ea;--orange:#e69f00;--green:#2fbf93;";

constexpr std::string_view frame_rules = R"css(
*{box-sizing:border-box}
body{margin:0;background:var(--bg);color:var(--ink);font:14px/1.45 system-ui,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
a{color:inherit;text-underline-offset:3px}
.top{background:var(--card);border-left:5px solid;padding:16px 22px 12px;border-bottom:1px solid var(--line)}
.headline{display:flex;gap:16px;justify-content:space-between;align-items:flex-start}
h1{font-size:19px;line-height:1.35;margin:0;overflow-wrap:anywhere}
h2{font-size:14.5px;margin:0}h3{font-size:12px;font-weight:400;color:var(--muted);margin:12px 0 4px}
nav{display:flex;gap:8px;flex:none}
button{font:inherit;font-size:13px;color:var(--ink);background:var(--card);border:1px solid var(--line);border-radius:6px;padding:4px 11px;cursor:pointer}
button:hover{border-color:var(--muted)}
:focus-visible{outline:2px solid var(--blue);outline-offset:2px}
.counts{margin:4px 0 0;color:var(--muted)}
.to-add{margin:10px 0 0;padding:8px 12px;background:var(--panel);border-radius:6px;overflow-wrap:anywhere}
.checks{list-style:none;display:flex;flex-wrap:wrap;gap:4px 26px;margin:10px 0 0;padding:0;overflow-wrap:anywhere}
.checks a{text-decoration:none}.checks a:hover{text-decoration:underline}
.state-good{color:var(--good)}.state-care{color:var(--care)}.state-bad,.state-not_converged{color:var(--bad)}
.state-refused{color:var(--refused)}.state-unknown{color:var(--muted)}
.border-good{border-left-color:var(--good)}.border-care{border-left-color:var(--care)}.border-unknown{border-left-color:var(--muted)}
.border-bad,.border-not_converged{border-left-color:var(--bad)}.border-refused{border-left-color:var(--refused)}
main{display:grid;grid-template-columns:repeat(24,minmax(0,1fr));gap:14px;padding:14px 20px;max-width:1800px;margin:auto}
.card{grid-column:span var(--span);min-width:0;background:var(--card);border:1px solid var(--line);border-radius:8px;padding:11px 13px;scroll-margin-top:10px}
.card:target{border-color:var(--blue);box-shadow:0 0 0 1px var(--blue)}
.title{display:flex;flex-wrap:wrap;justify-content:space-between;align-items:baseline;gap:0 14px;margin-bottom:8px}
.title span,.good,.left-out{color:var(--muted);font-size:12.5px}.good{margin:8px 0 0}
.card svg{display:block;width:100%;height:auto;max-height:1100px}
.narrow{display:none!important}
.choices{display:flex;gap:16px;font-size:13px;margin:-2px 0 6px;color:var(--muted)}.choices input{accent-color:var(--blue);margin:0 3px 0 0;vertical-align:-1px}
.caption{margin:0 0 6px;font-size:13px;overflow-wrap:anywhere}
.pair{display:grid;grid-template-columns:1fr 1fr;gap:12px}.pair figure{margin:0;min-width:0}.pair img{width:100%;display:block;border-radius:4px}
figcaption{font-size:12px;color:var(--muted);overflow-wrap:anywhere;margin-top:3px}
summary{cursor:pointer;color:var(--muted);font-size:13px}
.thumbs>div{display:grid;grid-template-columns:repeat(auto-fill,minmax(175px,1fr));gap:12px;margin-top:8px}
.thumb{margin:0;cursor:pointer;border-radius:6px;padding:4px;border:2px solid transparent;content-visibility:auto;contain-intrinsic-size:auto 165px}
.thumb.chosen{border-color:var(--orange)}
.reasons{margin-top:6px;font-size:13px}.reasons ul,footer ul{margin:4px 0;padding-left:20px;overflow-wrap:anywhere}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}th{text-align:left;font-weight:400}
.estimate{width:100%}.estimate th,.estimate td{padding:2.6px 6px 2.6px 0;vertical-align:baseline}
.estimate th{overflow-wrap:anywhere;min-width:5em}.estimate .value{text-align:right;font-weight:600;white-space:nowrap}
.estimate td{color:var(--muted);white-space:nowrap}.estimate .value,.estimate .word{color:var(--ink)}.estimate .word{white-space:normal;text-align:right;overflow-wrap:anywhere}.unit{text-align:right}
.estimate thead th{font-size:12.5px;color:var(--muted);text-align:center}
.scroll{overflow-x:auto}
.data{font-size:12px}.data th,.data td{padding:2px 10px 2px 0;text-align:right;white-space:nowrap}.data th{color:var(--muted)}
.data .word{text-align:left}.hash{font-family:ui-monospace,"DejaVu Sans Mono",monospace;font-size:11px}
.below{padding:0 20px 8px;max-width:1800px;margin:auto}.below>section,footer{background:var(--card);border:1px solid var(--line);border-radius:8px;padding:11px 13px;margin-bottom:14px}
.below details{margin:5px 0}.left-out{margin:0 0 12px}
.provenance th{color:var(--muted);padding:1px 18px 1px 0;vertical-align:top}.provenance td{overflow-wrap:anywhere}
code{font:12px ui-monospace,"DejaVu Sans Mono",monospace}
.shared{position:absolute;width:0;height:0;overflow:hidden}
)css";

constexpr std::string_view drawing_rules = R"css(
svg text{font-family:inherit}:where(path:not([fill])){fill:none}
.tick,.small{font-size:11.5px;fill:var(--muted)}.label{font-size:12px;fill:var(--ink)}
.gridline{stroke:var(--line)}.axis{stroke:var(--muted)}.panel{fill:var(--panel);stroke:var(--line)}
.curve,.curve-dashed{fill:none;stroke:var(--ink);stroke-width:1.8}.curve-dashed{stroke-dasharray:6 4}
.curve-blue{stroke:var(--blue);stroke-width:1.8;stroke-dasharray:8 3}.curve-orange{stroke:var(--orange);stroke-width:1.8;stroke-dasharray:2 3}
.dashed{stroke:var(--ink);stroke-dasharray:5 4}
.contour{stroke:#fff;stroke-width:1.3}.badge{fill:#000;fill-opacity:.74}.badge-text{fill:#fff;font-size:12px;font-weight:600}
.corner-dots{stroke:#fff;stroke-opacity:.5;stroke-width:2.2;stroke-linecap:round}
.dots{stroke-linecap:round;stroke-width:4.4}.many .dots{stroke-width:2}.many .corner-dots{stroke-width:1;stroke-opacity:.3}
.many .sheet{fill-opacity:.07;stroke-opacity:.5}.many .chosen .sheet{fill-opacity:.6;stroke-opacity:1}.cell{fill:none;stroke:var(--line)}
.mean{stroke:var(--ink);stroke-width:1.7}.mean-bold{stroke:var(--bad);stroke-width:3.6}
.mean-halo{stroke:var(--panel);stroke-width:4.6;stroke-opacity:.85}.mean-halo-bold{stroke:var(--panel);stroke-width:6.6;stroke-opacity:.85}
.halo{stroke:#000;stroke-opacity:.6;stroke-width:3.6}.vector{stroke:#fff;stroke-width:1.6}
.bar{stroke:var(--ink);stroke-width:1.8}.bar-light{stroke:#fff;stroke-width:2}
.bar-fill,.photo-bar{fill:var(--blue)}.on-bar{font-size:11.5px;font-weight:600;fill:var(--card)}.bar-muted{fill:var(--muted)}.unused-bar{fill:url(#hatch);stroke:var(--muted)}
.pick{cursor:pointer}.pick:hover .photo-bar{fill-opacity:.8}.chosen .photo-bar{fill:var(--orange)}
.frustum{stroke:var(--ink);stroke-width:1.3}.sheet{fill-opacity:.3;stroke:var(--muted);stroke-width:1}.board:hover .sheet{fill-opacity:.75}
.when-chosen{display:none}.chosen .when-chosen{display:inline}.chosen .sheet{stroke:var(--orange);stroke-width:2.4;fill-opacity:.55}
.rays{stroke:var(--orange);stroke-width:1;stroke-opacity:.8}.chequers{fill:var(--orange)}
.axis-x{stroke:#d55e00;stroke-width:2.2}.axis-y{stroke:#009e73;stroke-width:2.2}.axis-z{stroke:#0072b2;stroke-width:2.2}
.axis-name-x,.axis-name-y,.axis-name-z{font-size:13px;font-weight:600;fill:var(--ink)}
.no-picture{fill:var(--panel);stroke:var(--line)}
.photo-arrow{stroke:#000;stroke-opacity:.65;stroke-width:4}.photo-arrow-top{stroke:#fff;stroke-width:1.9}
.photo-dots{stroke-linecap:round;stroke-width:6.5}.ellipse{stroke:#ffd84d;stroke-width:1.2;stroke-opacity:.75}.rejected{stroke:#ff4d2e;stroke-width:2.4}
.error{stroke-width:1.6}.error.blue{stroke:var(--blue)}.error.orange{stroke:var(--orange)}.mark.blue{fill:var(--blue)}.mark.orange{fill:var(--orange)}
.board-point{stroke:var(--line)}.board-ring{fill:none;stroke:var(--ink);stroke-width:1.4}
.next-sheet{fill:#fff;stroke:#444}.next-square{fill:#222}
.diagonal{fill:var(--line)}.on-dark{font-size:10px;font-weight:600;fill:#fff}.on-light{font-size:10px;font-weight:600;fill:var(--ink)}
.matrix{max-width:360px}.card svg.key{max-width:520px}
)css";

constexpr std::string_view time_rules = R"css(
.panels{display:grid;grid-template-columns:repeat(2,minmax(0,1fr));gap:10px 16px;align-items:start}
.legend{display:flex;flex-wrap:wrap;gap:2px 18px;margin:0 0 6px;font-size:12.5px;color:var(--muted)}.legend span{white-space:nowrap}
.card svg.sample,.card svg.sample-mark{display:inline-block;width:26px;height:12px;vertical-align:-1px;margin:0 6px 0 0}.card svg.sample-mark{width:12px}
.line-blue{stroke:var(--blue);stroke-width:1.7;stroke-linejoin:round}.line-orange{stroke:var(--orange);stroke-width:2}.line-near{stroke:var(--blue);stroke-width:1;stroke-opacity:.5}
.line-error{stroke:var(--muted);stroke-width:.9;stroke-opacity:.75}.band{fill:var(--blue);fill-opacity:.2}
.truth{stroke:var(--ink);stroke-width:1.5;stroke-dasharray:6 4}.bound{stroke:var(--orange);stroke-width:2;stroke-dasharray:2 3}
.series-x{stroke:var(--blue);stroke-width:1.7}.series-y{stroke:var(--orange);stroke-width:1.7;stroke-dasharray:9 3}.series-z{stroke:var(--green);stroke-width:1.9;stroke-dasharray:2 3}
.zoom-span{fill:var(--orange);fill-opacity:.16}.event-line{stroke:var(--orange);stroke-opacity:.6;stroke-dasharray:2 4}.event{fill:var(--orange)}
.limit-line{stroke:var(--bad);stroke-width:1.6}.care-line{stroke:var(--care);stroke-dasharray:7 3}.below-limit{fill:var(--bad);fill-opacity:.12}
.nis-dots,.residual-dots,.bearing-dots,.track-start{stroke-linecap:round;stroke:var(--blue);stroke-width:2.4}
.residual-dots{stroke-opacity:.45;stroke-width:3}.bearing-dots{stroke:var(--ink);stroke-width:4}.track-start{stroke-width:6.5;stroke:var(--ink)}
.left-out-mark{stroke:var(--orange);stroke-width:2}.ring{fill:none;stroke:var(--ink);stroke-width:1.3;stroke-dasharray:5 4}
.track{stroke:var(--blue);stroke-width:1.3;stroke-opacity:.8;stroke-linejoin:round}.centre-mark{stroke:var(--orange);stroke-width:2}
.sphere{fill:var(--panel);stroke:var(--muted)}.near-line{stroke:var(--muted);stroke-opacity:.22}.footprint{stroke:var(--orange);stroke-width:1.3;fill:none}
)css";

constexpr std::string_view beam_rules = R"css(
.beam{stroke:var(--bad);stroke-width:1.8}.beam-cone{fill:var(--bad);fill-opacity:.16;stroke:var(--bad);stroke-opacity:.45;stroke-width:1}
.beam-ring{stroke:var(--bad);stroke-opacity:.75}.origin-ellipsoid{fill:var(--bad);fill-opacity:.3;stroke:var(--bad)}.beam-origin{fill:var(--bad);stroke:var(--card);stroke-width:1.2}
.plane{fill:var(--blue);fill-opacity:.12;stroke:var(--blue);stroke-opacity:.8}.plane-unused{fill:url(#hatch);fill-opacity:.3;stroke:var(--muted);stroke-dasharray:4 3}
.hit{fill:var(--blue);stroke:var(--card)}.hit-unused{fill:var(--card);stroke:var(--muted);stroke-width:1.3}
.chosen .plane,.chosen .plane-unused{stroke:var(--orange);stroke-opacity:1;stroke-width:2.4}.chosen .hit{fill:var(--orange)}.board:hover .plane{fill-opacity:.35}
.expected{fill:var(--muted);fill-opacity:.26}.unused-span{fill:url(#hatch);fill-opacity:.28}.chosen .slot{fill:var(--orange);fill-opacity:.14}.slot{fill:transparent}
.left-ring{fill:none;stroke:var(--ink);stroke-width:1.3}.cross-mark{stroke:var(--bad);stroke-width:2.2}.mark.ink{fill:var(--ink)}
.bound-under{stroke:var(--orange);stroke-opacity:.4;stroke-width:8;stroke-linejoin:round}.ellipse-fill{fill:var(--blue);fill-opacity:.22;stroke:var(--blue);stroke-width:1.6}.cell-number{font-size:11px;text-anchor:middle}
.best-cell{fill:none;stroke:var(--orange);stroke-width:3.2}.chips>div{display:flex;flex-wrap:wrap;gap:6px}.chips figcaption{margin:0}
.beam-line-halo{stroke:#000;stroke-opacity:.55;stroke-width:3.6}.beam-line{stroke:#ff5a36;stroke-width:1.7}.beam-mark{fill:#ff5a36;stroke:#000;stroke-opacity:.6}
.spot-halo{stroke:#000;stroke-opacity:.65;stroke-width:4}.spot-seen{stroke:#fff;stroke-width:1.9}.spot-other{stroke:#fff;stroke-opacity:.75;stroke-width:5;stroke-linecap:round}
.spot-predicted{stroke:#ffd84d;stroke-width:2}.inset{fill:#262b31}.inset-halo{fill:none;stroke:#000;stroke-opacity:.7;stroke-width:7}.inset-frame{fill:none;stroke:#fff;stroke-width:3}.empty-picture{fill:#3a4048}
)css";

constexpr std::string_view size_rules = R"css(
@media(min-width:1000px) and (max-width:1380px){main{grid-auto-flow:dense}
.card:not([style*=":24"],[style*=":18"],[style*=":16"],[style*=":14"]){grid-column:span 12}.card[style*=":18"],.card[style*=":16"],.card[style*=":14"]{grid-column:span 24}}
@media(max-width:999px){main{display:block;padding:12px}.card{margin-bottom:12px}.below{padding:0 12px 8px}
.card svg{max-width:680px;margin:auto}.card svg.stage{max-width:100%}.wide{display:none!important}.narrow{display:block!important}.card svg.narrow{max-width:100%}
.thumbs>div{grid-template-columns:repeat(auto-fill,minmax(140px,1fr))}.matrix{max-width:380px!important}}
@media(max-width:640px){.panels{display:block}.headline{flex-direction:column-reverse;gap:8px}h1{font-size:17px}.top{padding:12px 14px}}
@media print{body{background:#fff;font-size:11px}main{display:block;padding:0}nav,.choices{display:none}.below{padding:0}
.card,.below>section,footer{break-inside:avoid;margin-bottom:10px}.card svg{max-width:150mm;max-height:190mm;margin:auto}
.wide{display:none!important}.narrow{display:block!important}*{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
)css";

}  // namespace

std::string page_style() {
  std::string out = fmt::format(
      ":root{{{0}}}@media(prefers-color-scheme:dark){{:root:not([data-theme=light]){{{1}}}}}:root[data-theme=dark]{{{1}"
      "}}",
      light_colours, dark_colours);
  out += frame_rules;
  out += drawing_rules;
  out += time_rules;
  out += beam_rules;
  for (int direction = 0; direction < num_directions; ++direction)
    out += fmt::format(".d{}{{stroke:{}}}", direction, hex(direction_colour(direction)));
  out += size_rules;
  return out +
         fmt::format("@media print{{:root,:root[data-theme],:root:not([data-theme=light]){{{}}}}}", light_colours);
}

}  // namespace alidade::report
