"""The look of the report: its style sheet and the frame around its sections."""

STYLE = """
:root { color-scheme: light dark; --bg: #f6f7f9; --card: #ffffff; --ink: #1c2430; --soft: #5b6675;
  --line: #e2e6ec;
  --grid: #e6e9ee; --accent: #0f7cc0; --bestbg: #eef6f2; }
@media (prefers-color-scheme: dark) { :root { --bg: #12161c; --card: #1a2028; --ink: #e4e8ee; --soft: #9aa5b4;
  --line: #2b333f; --grid: #2b333f; --accent: #56b4e9; --bestbg: #16291f; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--bg); color: var(--ink); font: 16px/1.55 system-ui, -apple-system,
  "Segoe UI",
  Roboto, "Helvetica Neue", "DejaVu Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 28px 20px 60px; }
header { margin-bottom: 22px; }
.eyebrow { color: var(--soft); font-size: 13px; letter-spacing: .08em; text-transform: uppercase; margin: 0; }
h1 { font-size: 30px; line-height: 1.2; margin: 2px 0 12px; font-weight: 650; overflow-wrap: anywhere; }
.verdict { font-size: 18px; max-width: 62em; margin: 0; }
h2 { font-size: 19px; margin: 0 0 4px; font-weight: 620; }
h3 { font-size: 14px; margin: 0 0 8px; font-weight: 600; color: var(--soft); }
.note { color: var(--soft); font-size: 14px; margin: 0 0 12px; max-width: 72em; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 18px 20px;
  margin: 0 0 18px;
  min-width: 0; }
.pair { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 22px; }
.pair > div { min-width: 0; }
.scroll { overflow-x: auto; }
.facts { display: grid; grid-template-columns: repeat(4, minmax(0, 1fr)); gap: 14px; margin: 20px 0; }
.fact { background: var(--card); border: 1px solid var(--line); border-left: 4px solid var(--law,
  var(--line));
  border-radius: 8px; padding: 10px 14px; }
.fact b { display: block; font-size: 22px; font-weight: 620; line-height: 1.3; white-space: nowrap; }
.fact b small { font-size: 14px; font-weight: 500; }
.fact span { color: var(--soft); font-size: 13px; display: block; line-height: 1.4; }
.fact .name { color: var(--ink); font-weight: 600; }
table { border-collapse: collapse; width: 100%; font-size: 14px; font-variant-numeric: tabular-nums; }
th, td { padding: 5px 7px; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { font-weight: 550; color: var(--soft); font-size: 13px; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
tbody tr:last-child td { border-bottom: 0; }
tr.kind td { color: var(--soft); font-size: 12px; letter-spacing: .06em; text-transform: uppercase;
  padding-top: 14px; }
td.best { font-weight: 680; background: var(--bestbg); }
td.text { text-align: left; white-space: normal; }
i.dot { display: inline-block; width: 10px; height: 10px; border-radius: 50%; margin-right: 7px;
  background: var(--law); }
.chips { position: sticky; top: 0; z-index: 5; background: var(--bg); padding: 8px 0; display: flex;
  flex-wrap: wrap;
  gap: 8px; margin-bottom: 10px; }
.chips button, .chips select { font: inherit; font-size: 14px; color: var(--ink); background: var(--card);
  border: 1px solid var(--line); border-radius: 999px; padding: 4px 13px; cursor: pointer; }
.chips button[aria-pressed="false"] { opacity: .45; text-decoration: line-through; }
.chips button:focus-visible, summary:focus-visible, select:focus-visible { outline: 2px solid var(--accent); }
.inline { font-size: 14px; color: var(--soft); }
.inline select { font: inherit; color: var(--ink); background: var(--card); border: 1px solid var(--line);
  border-radius: 6px; padding: 2px 6px; }
.plot { width: 100%; overflow: hidden; }
#path { height: 480px; } #distance { height: 470px; } #position, #orientation { height: 560px; }
.bar { height: 300px; } #events { height: 220px; }
details > summary { cursor: pointer; font-weight: 600; }
pre { overflow-x: auto; font: 13px/1.5 ui-monospace, SFMono-Regular, Menlo, Consolas, "DejaVu Sans Mono",
  monospace;
  margin: 12px 0 0; }
footer { color: var(--soft); font-size: 13px; }
@media (max-width: 820px) { .pair { grid-template-columns: minmax(0, 1fr); } .facts {
  grid-template-columns: repeat(2, minmax(0, 1fr)); } }
@media (max-width: 520px) { main { padding: 16px 8px 40px; } h1 { font-size: 25px; } .verdict {
  font-size: 16px; }
  .card { padding: 14px 10px; } table { font-size: 11.5px; } th { font-size: 11.5px; white-space: normal; }
  th, td { padding: 5px 2px; } i.dot { width: 8px; height: 8px; margin-right: 4px; } h2 { font-size: 17px; }
  .fact b { font-size: 18px; } #path { height: 340px; } #position, #orientation { height: 480px; } .chips {
    gap: 6px; }
  .chips button { padding: 3px 10px; font-size: 13px; } }
@media print { .chips { display: none; } body { background: #fff; } .card { break-inside: avoid; } }
"""


def page(title: str, body: str, plotly: str, data: str, script: str) -> str:
    """A whole HTML page. ``title`` and ``body`` are HTML already, ``data`` is JSON safe in a script."""
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>{STYLE}</style>
</head>
<body>
<main>
{body}
</main>
<script>{plotly}</script>
<script type="application/json" id="data">{data}</script>
<script>{script}</script>
</body>
</html>
"""
