"""Networks over windows of signals: a 1-D convolution, a GRU and a small transformer, bagged, trained with JAX.

A window is X (T, c): T steps of time and c channels, of any motion and any arm. Each network makes features of width w
at every step, averages them over time, and answers with one hidden layer:

    phi = W₂·relu(W₁·mean_t h_t + b₁) + b₂

- `conv`: h = relu(K₀ * x), then twice h ← h + relu(K * h): kernels of 3 steps, 1, 2 and 4 apart.
- `gru`: h_t from h_{t−1} and x_t by the gated recurrent unit (Cho et al., EMNLP 2014).
- `transformer`: x_t to w, a learned position added, then two blocks of attention with four heads and of a hidden layer,
  both normalised first (Vaswani et al. 2017; Xiong et al. 2020).
"""

from __future__ import annotations

import logging
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator

from armload.ensembles.adam import AdamState, adam_step
from armload.ensembles.weak_learner import BOOTSTRAP, HOLD_OUT, INITIAL_WEIGHTS, SHUFFLE
from armload.errors import ModelError
from armload.runtime.interruption import put_off

ARCHITECTURES = ("conv", "gru", "transformer")
_HEADS, _BLOCKS = 4, 2  # of the transformer
_APART = (1, 2, 4)  # [steps] between the three weights of a kernel, layer by layer
_CHECKS = 20  # times in a training that the validation loss is looked at
_CHUNK = 500  # windows answered at once: bounds the memory
_WARM_UP = 100  # steps in which the learning rate rises
_CLIP = 1.0  # [1] a gradient longer than this is shortened to it


class WindowNetworks(BaseEstimator):
    """A bag of networks over windows, by Adam on the squared error of standardised outputs.

    The learning rate rises for 100 steps and falls to 0 as a cosine. The weights of a member are those with the best
    validation loss among 20 looks.

    >>> X = np.random.default_rng(0).normal(size=(64, 8, 2))
    >>> bag = WindowNetworks("conv", members=2, width=8, steps=40).fit(X, X.mean(axis=1))
    >>> bag.predict(X[:3]).shape
    (3, 2)

    Args:
        architecture: one of `ARCHITECTURES`.
        members: networks, each with its own draw of the windows, with replacement, and its own first weights.
        width: w, of all layers; a multiple of 4.
        steps: of Adam; batch: windows in each; learning_rate: its largest step.
        hold_out: share of the windows that validate. seed: of every draw.

    Attributes:
        losses_: (looks, members) validation losses in standardised units.
    """

    def __init__(
        self,
        architecture: str = "conv",
        members: int = 3,
        width: int = 48,
        steps: int = 2000,
        batch: int = 64,
        learning_rate: float = 2e-3,
        hold_out: float = 0.1,
        seed: int = 0,
    ) -> None:
        self.architecture = architecture
        self.members = members
        self.width = width
        self.steps = steps
        self.batch = batch
        self.learning_rate = learning_rate
        self.hold_out = hold_out
        self.seed = seed

    def fit(self, X: NDArray, y: NDArray) -> Self:
        """Train on windows X (N, T, c) and outputs y (N, k).

        Raises:
            ModelError: an unknown architecture, a width it cannot have, other shapes, or fewer than ten windows.
        """
        self._check(X, y)
        self.x_mean_, self.x_scale_ = X.mean(axis=(0, 1)), _filled(X.std(axis=(0, 1)))
        self.y_mean_, self.y_scale_ = y.mean(axis=0), _filled(y.std(axis=0))
        windows, outputs = self._scaled(X), ((y - self.y_mean_) / self.y_scale_).astype(np.float32)
        order = np.random.default_rng([self.seed, 0, HOLD_OUT]).permutation(len(X))
        held, kept = np.split(order, [max(1, round(self.hold_out * len(X)))])
        steps_function, loss_function, _ = _functions(self.architecture)
        drawn = [self._first_weights(m, X.shape[1], X.shape[2], y.shape[1]) for m in range(self.members)]
        weights = {name: np.stack([w[name] for w in drawn]) for name in drawn[0]}
        zeros = {name: np.zeros_like(w) for name, w in weights.items()}
        state = AdamState(weights, zeros, zeros, np.float32(0))
        best, least, losses = weights, np.full(self.members, np.inf), []
        batches = np.stack([self._batches(kept, m) for m in range(self.members)], axis=1)  # (steps, M, batch)
        for part in np.array_split(np.arange(self.steps), min(_CHECKS, self.steps)):
            with put_off():
                state = steps_function(state, windows, outputs, batches[part], self._rates(part))
                found = np.asarray(loss_function(state.weights, windows[held], outputs[held]), dtype=float)
            losses.append(found)
            better = found < least
            least = np.where(better, found, least)
            best = {
                name: np.where(better.reshape(-1, *[1] * (w.ndim - 1)), np.asarray(state.weights[name]), w)
                for name, w in best.items()
            }
        self.losses_, self.weights_ = np.array(losses), best
        if not np.all(np.isfinite(least)):
            raise ModelError("network training diverged: the validation loss was never finite; lower learning_rate")
        return self

    def predict(self, X: NDArray) -> NDArray[np.float64]:
        """The members' mean (N, k) for windows X (N, T, c)."""
        forward = _functions(self.architecture)[2]
        windows = self._scaled(X)
        parts = [forward(self.weights_, windows[k : k + _CHUNK]) for k in range(0, len(windows), _CHUNK)]
        answers = np.concatenate([np.asarray(part, dtype=float) for part in parts], axis=1)  # (M, N, k)
        return self.y_mean_ + self.y_scale_ * answers.mean(axis=0)

    def _check(self, X: NDArray, y: NDArray) -> None:
        if self.architecture not in ARCHITECTURES:
            expected = ", ".join(ARCHITECTURES)
            raise ModelError(f"unknown architecture {self.architecture!r}: expected one of {expected}")
        if self.width < _HEADS or self.width % _HEADS:
            raise ModelError(f"width is {self.width}: expected a multiple of {_HEADS}")
        if X.ndim != 3 or y.ndim != 2 or len(X) != len(y) or len(X) < 10:
            raise ModelError(f"windows {X.shape} and outputs {y.shape}: expected (N, T, c) and (N, k), at least ten")

    def _scaled(self, X: NDArray) -> NDArray[np.float32]:
        return ((X - self.x_mean_) / self.x_scale_).astype(np.float32)

    def _batches(self, kept: NDArray, member: int) -> NDArray[np.int32]:
        """(steps, batch) windows: a member's own draw, shuffled anew whenever it is used up."""
        own = np.random.default_rng([self.seed, member, BOOTSTRAP]).choice(kept, len(kept))
        rng, needed = np.random.default_rng([self.seed, member, SHUFFLE]), self.steps * self.batch
        epochs = [rng.permutation(own) for _ in range(-(-needed // len(own)))]
        return np.concatenate(epochs)[:needed].reshape(self.steps, self.batch).astype(np.int32)

    def _rates(self, steps: NDArray) -> NDArray[np.float32]:
        rising = np.minimum(1.0, (steps + 1) / _WARM_UP)
        return (self.learning_rate * rising * 0.5 * (1.0 + np.cos(np.pi * steps / self.steps))).astype(np.float32)

    def _first_weights(self, member: int, length: int, channels: int, outputs: int) -> dict[str, NDArray[np.float32]]:
        """By name: W… uniform as Glorot & Bengio 2010 say, b… and p… zero, s… one."""
        rng = np.random.default_rng([self.seed, member, INITIAL_WEIGHTS])
        weights = {}
        for name, shape in _shapes(self.architecture, length, channels, self.width, outputs).items():
            bound = np.sqrt(6.0 / sum(shape)) if name[0] == "W" else 0.0
            weights[name] = (rng.uniform(-bound, bound, shape) + (name[0] == "s")).astype(np.float32)
        return weights


def _filled(scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """1 where a column is constant."""
    return np.where(scale > 1e-9, scale, 1.0)


def _shapes(architecture: str, length: int, channels: int, w: int, outputs: int) -> dict[str, tuple[int, ...]]:
    head = {"W_hidden": (w, w), "b_hidden": (w,), "W_out": (w, outputs), "b_out": (outputs,)}
    if architecture == "conv":
        first = {"W0": (3 * channels, w), "b0": (w,)}
        return first | {f"{x}{k}": s for k in (1, 2) for x, s in (("W", (3 * w, w)), ("b", (w,)))} | head
    if architecture == "gru":
        return {"Wx": (channels, 3 * w), "Wh": (w, 3 * w), "b": (3 * w,), "b_new": (w,)} | head
    parts = {"W_in": (channels, w), "b_in": (w,), "p": (length, w), "s_end": (w,)}
    for k in range(_BLOCKS):
        parts |= {f"s_attend{k}": (w,), f"W_heads{k}": (w, 3 * w), f"W_join{k}": (w, w), f"s_wide{k}": (w,)}
        parts |= {f"W_up{k}": (w, 2 * w), f"b_up{k}": (2 * w,), f"W_down{k}": (2 * w, w), f"b_down{k}": (w,)}
    return parts | head


@cache
def _functions(architecture: str) -> tuple[Any, Any, Any]:
    """The three compiled computations: many steps of training, the validation loss, the answers. JAX comes in here."""
    logging.getLogger("jax._src.xla_bridge").setLevel(logging.ERROR)
    import jax
    import jax.numpy as jnp

    relu = jax.nn.relu

    def convolution(p: dict, x: Any) -> Any:
        h = x
        for k, apart in enumerate(_APART):
            padded = jnp.pad(h, ((0, 0), (apart, apart), (0, 0)))
            near = jnp.concatenate([padded[:, : h.shape[1]], h, padded[:, 2 * apart :]], axis=2)
            made = relu(near @ p[f"W{k}"] + p[f"b{k}"])
            h = made if k == 0 else h + made
        return h

    def recurrence(p: dict, x: Any) -> Any:
        gates = jnp.swapaxes(x @ p["Wx"] + p["b"], 0, 1)  # (T, B, 3w)

        def step(h: Any, given: Any) -> tuple[Any, Any]:
            reset, update, new = jnp.split(given, 3, axis=1)
            own = jnp.split(h @ p["Wh"], 3, axis=1)
            keep = jax.nn.sigmoid(update + own[1])
            new = jnp.tanh(new + jax.nn.sigmoid(reset + own[0]) * (own[2] + p["b_new"]))
            h = keep * h + (1.0 - keep) * new
            return h, h

        start = jnp.zeros((x.shape[0], p["Wh"].shape[0]), x.dtype)
        return jnp.swapaxes(jax.lax.scan(step, start, gates)[1], 0, 1)

    def normalised(h: Any, scale: Any) -> Any:
        h = h - h.mean(axis=2, keepdims=True)
        return scale * h * jax.lax.rsqrt((h * h).mean(axis=2, keepdims=True) + 1e-5)

    def attention(p: dict, x: Any) -> Any:
        h = x @ p["W_in"] + p["b_in"] + p["p"]
        batch, length, w = h.shape
        for k in range(_BLOCKS):
            split = (normalised(h, p[f"s_attend{k}"]) @ p[f"W_heads{k}"]).reshape(batch, length, 3, _HEADS, w // _HEADS)
            query, key, value = (split[:, :, i] for i in range(3))
            like = jnp.einsum("bthd,bshd->bhts", query, key) / np.sqrt(w / _HEADS)
            seen = jnp.einsum("bhts,bshd->bthd", jax.nn.softmax(like, axis=3), value)
            h = h + seen.reshape(batch, length, w) @ p[f"W_join{k}"]
            wide = relu(normalised(h, p[f"s_wide{k}"]) @ p[f"W_up{k}"] + p[f"b_up{k}"])
            h = h + wide @ p[f"W_down{k}"] + p[f"b_down{k}"]
        return normalised(h, p["s_end"])

    body = {"conv": convolution, "gru": recurrence, "transformer": attention}[architecture]

    def answer(p: dict, x: Any) -> Any:  # one member: (B, k)
        return relu(body(p, x).mean(axis=1) @ p["W_hidden"] + p["b_hidden"]) @ p["W_out"] + p["b_out"]

    def loss(p: dict, x: Any, y: Any) -> Any:
        error = answer(p, x) - y
        return jnp.mean(error * error)

    gradients = jax.vmap(jax.grad(loss))

    def shortened(g: dict) -> dict:  # each member's own
        length = jnp.sqrt(sum(jnp.sum(v * v, axis=tuple(range(1, v.ndim))) for v in g.values()))
        factor = jnp.minimum(1.0, _CLIP / (length + 1e-9))
        return {name: v * factor.reshape(-1, *[1] * (v.ndim - 1)) for name, v in g.items()}

    @jax.jit
    def steps(state: AdamState, X: Any, y: Any, batches: Any, rates: Any) -> AdamState:
        def step(state: AdamState, given: Any) -> tuple[AdamState, None]:
            rows, rate = given
            return adam_step(state, shortened(gradients(state.weights, X[rows], y[rows])), rate), None

        return jax.lax.scan(step, state, (batches, rates))[0]

    return steps, jax.jit(jax.vmap(loss, in_axes=(0, None, None))), jax.jit(jax.vmap(answer, in_axes=(0, None)))
