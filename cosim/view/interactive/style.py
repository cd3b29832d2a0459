"""CSS of the page: the whole window, dark, one column per drive."""

STYLE = """
:root { color-scheme: dark; --ground: #0d1016; --panel: #151a23; --line: #262d39; --text: #e2e8f0; --muted: #8d99ad;
  --accent: #ffb23e; }
* { box-sizing: border-box; }
html, body { height: 100%; margin: 0; }
body { display: flex; flex-direction: column; background: var(--ground); color: var(--text); overflow: hidden;
  font: 14px/1.4 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
[hidden] { display: none !important; }
main { flex: 1; min-height: 0; display: grid; grid-auto-flow: column; grid-auto-columns: minmax(0, 1fr);
  grid-template-rows: auto minmax(0, 1.6fr) minmax(0, 1fr); column-gap: 2px; background: var(--line); }
main.imageless { grid-template-rows: auto minmax(0, 1fr) 34px; }
.pane { min-width: 0; display: grid; grid-template-rows: subgrid; grid-row: span 3; background: var(--ground); }
.pane header { display: flex; flex-wrap: wrap; align-items: baseline; gap: 2px 20px; padding: 7px 14px; }
h1 { margin: 0; font-size: 15px; font-weight: 650; overflow-wrap: anywhere; }
.facts { display: flex; flex-wrap: wrap; gap: 0 16px; font-variant-numeric: tabular-nums; }
.facts small { color: var(--muted); font-size: 12px; }
details { color: var(--muted); font-size: 12.5px; position: relative; margin-left: auto; }
summary { cursor: pointer; }
details ul { position: absolute; z-index: 3; right: 0; width: 46ch; margin: 4px 0 0; padding: 10px 14px 10px 28px;
  background: var(--panel); border: 1px solid var(--line); border-radius: 6px; }
.space { position: relative; overflow: hidden; }
.space canvas { position: absolute; inset: 0; width: 100%; height: 100%; }
.points { cursor: grab; touch-action: none; }
.over { pointer-events: none; }
.image canvas { cursor: crosshair; touch-action: none; }
.legend { position: absolute; left: 12px; top: 10px; padding: 8px 12px; border-radius: 6px; background: #0d1016cc;
  font-size: 12.5px; max-width: 250px; pointer-events: none; }
.legend strong { display: block; font-weight: 600; margin-bottom: 4px; }
.legend .muted { display: block; color: var(--muted); }
.bar { width: 216px; height: 10px; border-radius: 3px; }
.marks { position: relative; width: 216px; height: 18px; font-variant-numeric: tabular-nums; }
.marks span { position: absolute; transform: translateX(-50%); }
.marks span:first-child { transform: none; } .marks span:last-child { transform: translateX(-100%); }
.legend i { display: inline-block; width: 12px; height: 12px; margin-right: 7px; border-radius: 2px;
  vertical-align: -1px; }
.tip { position: absolute; margin: 0; padding: 6px 10px; background: #1b2230f0; border: 1px solid var(--line);
  border-radius: 6px; font: 12.5px/1.45 system-ui, sans-serif; pointer-events: none; z-index: 2; }
.space .fault { position: absolute; inset: 40% 10% auto; text-align: center; color: var(--accent); }
.image { min-height: 0; display: flex; justify-content: center; align-items: center; overflow: hidden;
  border-top: 2px solid var(--line); background: #090b10; }
.no-image { margin: 0; font-size: 13px; color: var(--muted); }
footer { display: flex; flex-wrap: wrap; align-items: center; gap: 7px 14px; padding: 8px 14px;
  background: var(--panel); border-top: 1px solid var(--line); }
footer > input { flex: 1; min-width: 160px; accent-color: var(--accent); }
output { min-width: 62px; font-variant-numeric: tabular-nums; color: var(--muted); }
[role=group] { display: flex; flex-wrap: wrap; gap: 4px; }
button { background: #1b2230; color: var(--text); border: 1px solid var(--line); border-radius: 5px;
  padding: 4px 10px; font: inherit; font-size: 13px; cursor: pointer; }
button[aria-pressed=true] { border-color: var(--accent); color: var(--accent); }
button:disabled { color: #566074; cursor: not-allowed; text-decoration: line-through; }
button:focus-visible, input:focus-visible { outline: 2px solid var(--accent); outline-offset: 1px; }
#play { width: 38px; } a { color: var(--accent); }
#fault { color: #ff7b72; } #waiting { color: var(--accent); }
#keys { position: fixed; right: 14px; bottom: 60px; z-index: 4; display: grid; grid-template-columns: auto 1fr;
  gap: 3px 16px; margin: 0; padding: 14px 18px; background: var(--panel); border: 1px solid var(--line);
  border-radius: 8px; max-width: 46ch; }
dt { color: var(--accent); white-space: nowrap; } dd { margin: 0; color: var(--muted); }
@media (max-width: 900px) { main { grid-auto-flow: row; } }
"""
