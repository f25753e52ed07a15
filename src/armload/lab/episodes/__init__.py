"""Episodes: populations of arms, motions, payloads and sensors, drawn by name and simulated by the thousand."""

from armload.lab.episodes.draw import draw_episodes
from armload.lab.episodes.episode import Episode, EpisodeLogs, simulate_episodes
from armload.lab.episodes.recipes import LIGHTEST, POPULATIONS, TOOL_SHARE, Recipe

__all__ = [
    "LIGHTEST",
    "POPULATIONS",
    "TOOL_SHARE",
    "Episode",
    "EpisodeLogs",
    "Recipe",
    "draw_episodes",
    "simulate_episodes",
]
