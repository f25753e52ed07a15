"""How the pages look: colours that can be read and mean something, and a sheet as wide as a phone."""

from __future__ import annotations

from html import escape

TEXT = "font-size:13px;line-height:1.45;font-variant-numeric:tabular-nums;padding:2px 8px"
SOFT = "color:var(--mantine-color-dimmed)"
WARNING = ' style="color:var(--mantine-color-red-text)"'

# viser's own grey and red have a contrast of 3.3 to white, the blue of its buttons and tabs 3.6 (3.1 in the dark). 4.5
# is the least for text of this size (WCAG 2.2, 1.4.3); these have 5 or more, on white as well as on viser's dark grey.
# On a phone viser makes its sheet 20em wide, which cuts the table off and leaves a strip of floor beside it. On a
# tablet held upright it leaves 120 px of picture between the two panels: there the picture is above them, as wide as
# the screen.
SHEET = """<style>
:root[data-mantine-color-scheme="light"] {
  --mantine-color-dimmed: #5c6570 !important; --mantine-color-red-text: #c92a2a !important;
  --armload-good: #237a34; --armload-wait: #b35900; --armload-act: #1864ab;
  --mantine-color-blue-filled: var(--armload-act) !important;
  --mantine-primary-color-filled: var(--armload-act) !important; }
:root[data-mantine-color-scheme="dark"] {
  --mantine-color-dimmed: #a3abb5 !important; --mantine-color-red-text: #ff8787 !important;
  --armload-good: #69db7c; --armload-wait: #ffa94d; --armload-act: #74c0fc; }
:root[data-mantine-color-scheme] { --mantine-color-blue-outline: var(--armload-act) !important; }
[role="tab"] { color: var(--armload-act) !important; }
@media (max-width: 36em) {
  .mantine-Paper-root[style*="width: 20em"],
  .mantine-Paper-root[style*="width: 20em"] .mantine-ScrollArea-content > [style*="width: 20em"] {
    width: 100vw !important; } }
[data-dock-root][data-dock-squeezing] > :first-child { inset: 0 0 60% 0 !important; }
[data-dock-root][data-dock-squeezing] > [data-dock-region] { top: 40% !important; width: 50% !important; }
[data-dock-root][data-dock-squeezing] > [data-dock-region] [style*="flex-direction: row"][style*="flex-shrink: 0"] {
  width: 100% !important; }
[data-dock-root][data-dock-squeezing] > :not(:first-child):not([data-dock-region]):not([data-floating-window]) {
  display: none !important; }
@keyframes armload-old { to { opacity: 0.35; filter: grayscale(1); } }
@keyframes armload-unheard { to { visibility: visible; max-height: 20em; } }
</style>"""

GOOD, WAIT, BAD = "var(--armload-good)", "var(--armload-wait)", "var(--mantine-color-red-text)"


def dot(colour: str) -> str:
    """A dot before a state, in `GOOD`, `WAIT` or `BAD`: the words beside it say the same."""
    return f'<span aria-hidden="true" style="color:{colour}">&#9679;</span>&ensp;'


# A browser hears nothing while the service is away, or the browser itself slept: a page cannot tell by itself. So each
# picture of the numbers is drawn anew with two animations that begin after this time [s]; the next one takes its place
# before, twenty times over (`page.serve`). The server is silent so long only if something is wrong.
HEARD = 4.0


def heard(html: str, beat: int) -> str:
    """What is shown as being so at present; grey once nothing has been heard for `HEARD` seconds.

    Args:
        html: what is shown. beat: another number for each second, so that it is drawn anew though nothing has changed.
    """
    if not html:
        return ""
    return f'<div data-beat="{beat}" style="animation:armload-old 0.2s linear {HEARD:g}s forwards">{html}</div>'


def unheard(beat: int) -> str:
    """What comes into view once nothing has been heard for `HEARD` seconds."""
    return (
        f'<div data-beat="{beat}" data-armload="unheard" data-spoken="nothing is heard of armload" '
        f'style="{TEXT};visibility:hidden;max-height:0;overflow:hidden;'
        f'animation:armload-unheard 0s linear {HEARD:g}s forwards">{dot(BAD)}<span{WARNING}>nothing is heard of '
        "armload: what is shown is old. It goes on by itself when armload is there again; if its token is new for each "
        "run, open the address that it prints.</span></div>"
    )


def awake(title: str) -> str:
    """What a page of viser's does not do by itself, and here is the only way to it for a script.

    viser connects again only while its window has the focus, which a display on a wall never has; it asks the page.
    And it calls every page "Viser": tabs of several arms, and what a screen reader says first, would be alike.

    Args:
        title: of the page; it may hold anything.
    """
    does = "document.hasFocus=()=>true;document.title=this.dataset.title"
    return f'<img alt="" src="data:," style="display:none" data-title="{escape(title)}" onerror="{does}">'
