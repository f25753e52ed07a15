"""How the pages look: colours that can be read and mean something, and a sheet as wide as a phone."""

from __future__ import annotations

TEXT = "font-size:13px;line-height:1.45;font-variant-numeric:tabular-nums;padding:2px 8px"
SOFT = "color:var(--mantine-color-dimmed)"
WARNING = ' style="color:var(--mantine-color-red-text)"'

# viser's own grey and red have a contrast of 3.3 to white, where 4.5 is the least for text of this size (WCAG 2.2,
# 1.4.3); these have 5 or more, on white as well as on viser's dark grey. On a phone viser makes its sheet 20em wide,
# which cuts the table off and leaves a strip of floor beside it.
SHEET = """<style>
:root[data-mantine-color-scheme="light"] {
  --mantine-color-dimmed: #5c6570 !important; --mantine-color-red-text: #c92a2a !important;
  --armload-good: #237a34; --armload-wait: #b35900; }
:root[data-mantine-color-scheme="dark"] {
  --mantine-color-dimmed: #a3abb5 !important; --mantine-color-red-text: #ff8787 !important;
  --armload-good: #69db7c; --armload-wait: #ffa94d; }
@media (max-width: 36em) {
  .mantine-Paper-root[style*="width: 20em"],
  .mantine-Paper-root[style*="width: 20em"] .mantine-ScrollArea-content > [style*="width: 20em"] {
    width: 100vw !important; } }
</style>"""

GOOD, WAIT, BAD = "var(--armload-good)", "var(--armload-wait)", "var(--mantine-color-red-text)"


def dot(colour: str) -> str:
    """A dot before a state, in `GOOD`, `WAIT` or `BAD`: the words beside it say the same."""
    return f'<span aria-hidden="true" style="color:{colour}">&#9679;</span>&ensp;'
