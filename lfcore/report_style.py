"""The style sheet of the report: light and dark, narrow and wide, on paper."""

STYLE = """
:root { color-scheme: light dark;
  --paper: #ffffff; --ink: #1b1d22; --soft: #5a606b; --line: #d9dce2; --panel: #f5f6f8;
  --c0: #00549f; --c1: #b54a00; --c2: #00785a; --c3: #7d3f9c; --c4: #6b6200; --c5: #a3214e; }
@media (prefers-color-scheme: dark) { :root {
  --paper: #15171b; --ink: #e8eaee; --soft: #a2a9b5; --line: #363b44; --panel: #1e2127;
  --c0: #6db3f2; --c1: #f09a5b; --c2: #58c9a3; --c3: #c795e2; --c4: #cfc45a; --c5: #f0839f; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem clamp(0.75rem, 3vw, 2.5rem) 4rem; max-width: 84rem; background: var(--paper);
  color: var(--ink); font: 16px/1.5 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0 0 0.5rem; }
h2 { font-size: 1.25rem; margin: 2.5rem 0 0.5rem; border-top: 1px solid var(--line); padding-top: 1.25rem; }
h3 { font-size: 1.05rem; margin: 1.75rem 0 0.5rem; }
p, li { max-width: 46rem; } p { margin: 0.4rem 0; }
.soft, figcaption, caption { color: var(--soft); font-size: 0.9rem; }
code { font: 0.85rem/1.4 ui-monospace, "DejaVu Sans Mono", monospace; overflow-wrap: anywhere; }
.scroll { overflow-x: auto; } .scroll:focus-visible { outline: 2px solid var(--c0); }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: 0.75rem 0; }
caption { text-align: left; padding-bottom: 0.4rem; }
th, td { padding: 0.3rem 0.75rem; text-align: right; white-space: nowrap; }
th[scope=row], thead th:first-child { text-align: left; font-weight: 500; }
thead th { font-weight: 600; border-bottom: 1px solid var(--line); } thead tr:first-child th[colspan] { text-align: center; }
tbody tr { border-bottom: 1px solid var(--line); } tfoot th, tfoot td { border-top: 2px solid var(--soft); }
td.first, th.first { border-left: 1px solid var(--line); } strong { font-weight: 700; }
.maps { display: flex; flex-wrap: wrap; gap: 1rem 2rem; }
.heat { border-spacing: 2px; border-collapse: separate; margin: 0.25rem 0; }
.heat td, .heat th { padding: 0; width: 2.6rem; height: 2rem; text-align: center; font-size: 0.78rem; }
.heat tbody tr { border: 0; } .heat th { color: var(--soft); font-weight: 400; width: 1.6rem; text-align: center; }
.heat thead th { border: 0; height: 1.2rem; } .heat thead th:first-child { text-align: center; }
.heat .input { color: var(--soft); border: 1px dashed var(--line); } .heat .none { background: var(--panel); }
.heat .own { outline: 2px solid var(--ink); outline-offset: -2px; }
.scale { display: inline-block; height: 0.8rem; width: 12rem; max-width: 40vw; vertical-align: middle; margin: 0 0.5rem;
  border: 1px solid var(--line); }
figure { margin: 0.75rem 0; } svg { max-width: 100%; height: auto; display: block; }
svg text { fill: var(--ink); font: 13px system-ui, "DejaVu Sans", sans-serif; } svg .soft { fill: var(--soft); }
svg .axis { stroke: var(--line); stroke-width: 1; }
.overview { position: relative; max-width: 34rem; } .overview img { display: block; width: 100%; height: auto; }
.overview svg { position: absolute; inset: 0; width: 100%; height: 100%; }
.crop td, .crop th { padding: 0.15rem 0.3rem; text-align: center; vertical-align: middle; }
.crop tbody tr { border: 0; } .crop img { width: 11rem; height: 11rem; display: block; image-rendering: pixelated; }
.crop thead th, .crop tbody th { font-weight: 500; line-height: 1.25; vertical-align: bottom; }
.crop tbody th { vertical-align: middle; text-align: left; }
@media (max-width: 40rem) { th, td { padding: 0.25rem 0.45rem; } .heat td { width: 2.1rem; font-size: 0.66rem; }
  .crop img { width: 8rem; height: 8rem; } }
@media print { :root { --paper: #fff; --ink: #000; --soft: #444; --line: #bbb; --panel: #f5f6f8;
  --c0: #00549f; --c1: #b54a00; --c2: #00785a; --c3: #7d3f9c; --c4: #6b6200; --c5: #a3214e; }
  body { max-width: none; padding: 0; font-size: 10pt; } h2, h3 { break-after: avoid; }
  figure, .heat, .crop tr, tr { break-inside: avoid; } .scroll { overflow: visible; }
  .heat td, .scale, svg * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  .crop img { width: 3.2cm; height: 3.2cm; } }
"""
