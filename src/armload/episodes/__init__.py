"""Episodes: populations of arms, motions, payloads and sensors, drawn by name and simulated by the thousand."""

from armload.episodes.draw import POPULATIONS, draw_episodes
from armload.episodes.episode import Episode, EpisodeLogs, simulate_episodes

__all__ = ["POPULATIONS", "Episode", "EpisodeLogs", "draw_episodes", "simulate_episodes"]
