"""One step of Adam on any tree of JAX arrays, by Algorithm 1 of Kingma & Ba 2015."""

from __future__ import annotations

from typing import Any, NamedTuple


class AdamState(NamedTuple):
    """weights, first and second moments of their gradients (three trees alike), steps taken."""

    weights: Any
    first: Any
    second: Any
    count: Any


def adam_step(state: AdamState, gradient: Any, rate: Any) -> AdamState:
    """The state after one step: β₁ = 0.9, β₂ = 0.999, ε = 1e-8; rate: the step's size."""
    import jax
    import jax.numpy as jnp

    count = state.count + 1
    first = jax.tree.map(lambda m, d: 0.9 * m + 0.1 * d, state.first, gradient)
    second = jax.tree.map(lambda v, d: 0.999 * v + 0.001 * d * d, state.second, gradient)
    c1, c2 = 1 - 0.9**count, 1 - 0.999**count
    weights = jax.tree.map(
        lambda w, m, v: w - rate * (m / c1) / (jnp.sqrt(v / c2) + 1e-8), state.weights, first, second
    )
    return AdamState(weights, first, second, count)
