"""What a screen reader is told of a page: changes without being asked, and names of what viser leaves without one."""

from __future__ import annotations

from html import escape

# Changes are told by a live region that stays (WCAG 2.2, 4.1.3): what is drawn anew ten times a second is none. What it
# says is the `data-spoken` of the page's state, without the numbers that change with each picture. Curves and picture
# are canvases: they are named, and say where the same is in words (1.1.1). A slider and the number beside it have the
# label before them, viser's menu and the controls of its panels none (4.1.2).
_SCRIPT = """
clearInterval(window.armloadSpoken);
const named = (x, name) => x && x.getAttribute('aria-label') !== name && x.setAttribute('aria-label', name);
const image = (x, name) => { x.setAttribute('role', 'img'); named(x, name); };
let live = document.getElementById('armload-live');
if (!live) {
  live = document.body.appendChild(document.createElement('div'));
  live.id = 'armload-live';
  live.setAttribute('role', 'status');
  live.style.cssText = 'position:absolute;width:1px;height:1px;overflow:hidden;clip-path:inset(50%)';
}
window.armloadSpoken = setInterval(() => {
  const unheard = document.querySelector('[data-armload=unheard]');
  const old = unheard && getComputedStyle(unheard).visibility === 'visible';
  const state = old ? unheard : document.querySelector('[data-armload=state][data-spoken]');
  const said = state ? state.dataset.spoken : '';
  if (live.textContent !== said) live.textContent = said;
  const legends = document.querySelectorAll('[data-armload=legend]'), plots = document.querySelectorAll('.uplot');
  if (legends.length === plots.length)
    plots.forEach((x, k) => image(x, 'curves of ' + legends[k].dataset.title + ' over time; numbers are in the table'));
  [...document.querySelectorAll('canvas')].filter(x => !x.closest('.uplot')).forEach((x, k) => k
    ? x.setAttribute('aria-hidden', 'true')
    : image(x, 'picture of the arm in three dimensions; what it shows is said in words beside it'));
  document.querySelectorAll('[role=slider]').forEach(x => {
    const root = x.closest('[id]'), label = root && document.querySelector(`label[for="${root.id}"]`);
    if (!label) return;
    named(x, label.innerText);
    named(root.parentElement.querySelector('input[type=text]'), label.innerText);
  });
  document.querySelectorAll('button:not([aria-label], [aria-labelledby])').forEach(x =>
    x.innerText.trim() || x.closest('[role=alert]') || named(x, 'menu of the viewer'));
}, 1000);
"""


def spoken() -> str:
    """HTML, once on a page, that names what has no name and tells what changes.

    What is to be told is the `data-spoken` of an element; a `data-armload="legend"` with a `data-title` names the plot
    that follows it.
    """
    return f'<img alt="" src="data:," style="display:none" data-armload="spoken" onerror="{escape(_SCRIPT)}">'
