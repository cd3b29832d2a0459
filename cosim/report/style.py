"""CSS of the pages: dark, one column, charts in a grid."""

STYLE = """
:root { color-scheme: dark; --ground: #0d1016; --panel: #151a23; --line: #262d39; --text: #e2e8f0; --muted: #8692a6;
  --accent: #ffb23e; --a: #ffb23e; --b: #5aa9ff; --c: #6fd08c; --d: #f0606a; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1840px; padding: 28px clamp(12px, 2.5vw, 40px) 60px; background: var(--ground);
  color: var(--text); font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
h1 { margin: 0 0 14px; font-size: 27px; font-weight: 650; letter-spacing: -.01em; overflow-wrap: anywhere; }
h2 { margin: 0 0 10px; font-size: 20px; font-weight: 650; overflow-wrap: anywhere; }
h3 { margin: 0; font-size: 15px; font-weight: 600; }
p { margin: 3px 0 0; color: var(--muted); max-width: 105ch; }
.verdict { font-size: 21px; line-height: 1.4; color: var(--text); max-width: 95ch; margin: 0 0 6px; }
.sources { color: var(--text); font-size: 16.5px; margin: 0 0 8px; max-width: none; }
.next { color: var(--muted); margin: 4px 0 0; } code { color: var(--accent); font-size: 14px; }
.good { color: var(--c); } .bad { color: var(--d); } .warn { color: var(--a); }
dl { display: flex; flex-wrap: wrap; align-items: end; gap: 8px 34px; margin: 18px 0 0; }
dt { color: var(--muted); font-size: 12px; } dd { margin: 0; font-size: 18px; font-variant-numeric: tabular-nums; }
dd small { color: var(--muted); font-size: 12.5px; }
section { border-top: 1px solid var(--line); padding-top: 22px; margin-top: 26px; }
section.plain { border: 0; margin-top: 8px; padding-top: 8px; }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(390px, 100%), 1fr)); gap: 16px;
  margin-top: 12px; }
.full { grid-column: 1 / -1; margin-top: 14px; }
figure { margin: 0; border: 1px solid var(--line); border-radius: 8px; background: var(--panel); overflow: hidden; }
figcaption { padding: 10px 14px 2px; } figcaption p { font-size: 13px; }
svg.plot { display: block; width: 100%; height: auto; padding: 4px 8px 6px; }
svg text { fill: var(--muted); font-size: 12px; font-variant-numeric: tabular-nums; }
svg .label { font-size: 12.5px; } svg .value { font-size: 12.5px; fill: var(--text); }
.grid { stroke: var(--line); stroke-width: 1; fill: none; } .axis { stroke: #4a5568; fill: none; }
.line { fill: none; stroke-width: 1.8; stroke-linejoin: round; } .band { opacity: .24; }
.line.a { stroke: var(--a); } .line.b { stroke: var(--b); } .line.c { stroke: var(--c); } .line.d { stroke: var(--d); }
.line.zero { stroke: #8692a6; stroke-width: 1; } .line.none { stroke: none; } .dot.none { fill: var(--a); }
.line.floor { stroke: var(--c); stroke-dasharray: 6 5; } .line.whisker { stroke: var(--text); stroke-width: 1.4; }
.line.link { stroke: var(--muted); stroke-width: 1; stroke-dasharray: 2 4; }
.band.a, .dot.a { fill: var(--a); } .band.b, .dot.b { fill: var(--b); } .dot.c { fill: var(--c); }
.band.fall { fill: var(--c); opacity: .55; } .band.rise { fill: var(--d); opacity: .6; }
.dot.whisker { fill: var(--text); } .dot.b { fill: var(--b); } .dot.c { fill: var(--c); }
canvas { display: block; width: 100%; height: auto; background: #0b0d16; cursor: grab; touch-action: none; }
.frames { display: flex; flex-wrap: wrap; gap: 8px; margin: 10px 0 12px; }
button { background: var(--panel); color: var(--text); border: 1px solid var(--line); border-radius: 6px;
  padding: 5px 12px; font: inherit; font-size: 14px; cursor: pointer; }
button[aria-pressed=true] { border-color: var(--accent); color: var(--accent); }
.legend { display: flex; flex-wrap: wrap; gap: 4px 22px; padding: 6px 14px 12px; color: var(--muted); font-size: 13px; }
.legend i { display: inline-block; width: 14px; height: 12px; border-radius: 2px; vertical-align: -1px; }
table { border-collapse: collapse; margin-top: 12px; font-variant-numeric: tabular-nums; font-size: 14px; }
th, td { padding: 5px 22px 5px 0; text-align: right; border-bottom: 1px solid var(--line); vertical-align: top; }
thead th { color: var(--muted); font-weight: 500; font-size: 12.5px; }
tbody th, .words { text-align: left; font-weight: 500; } td { white-space: nowrap; }
td.words { max-width: 80ch; white-space: normal; }
.meter { display: inline-block; width: 160px; height: 10px; background: #1d2430; border-radius: 3px; }
.meter i { display: block; height: 100%; background: var(--a); border-radius: 3px; }
.notes { margin: 8px 0 0; padding-left: 20px; color: var(--muted); }
.formula { font-size: 17px; color: var(--text); font-family: ui-monospace, monospace; }
details { margin-top: 14px; } summary { color: var(--muted); cursor: pointer; }
@media (max-width: 900px) { section { overflow-x: auto; } }
.stack { display: flex; height: 40px; border-radius: 8px; overflow: hidden; margin: 16px 0 0; max-width: 1200px; }
.stack i { font-style: normal; color: #0d1016; font-size: 14px; font-weight: 600; text-align: center; line-height: 40px;
  font-variant-numeric: tabular-nums; overflow: hidden; white-space: nowrap; min-width: 2px; }
.stacked { list-style: none; display: flex; flex-wrap: wrap; gap: 8px 30px; padding: 0; margin: 12px 0 0;
  font-variant-numeric: tabular-nums; max-width: 1500px; }
.stacked i { display: inline-block; width: 13px; height: 13px; border-radius: 3px; margin-right: 8px;
  vertical-align: -1px; }
.stacked small { color: var(--muted); font-size: 12.5px; } .stacked small + small { display: block; margin-left: 21px; }
a { color: var(--b); } button:focus-visible, [tabindex]:focus-visible, summary:focus-visible {
  outline: 2px solid var(--accent); outline-offset: 2px; }
"""
