"""Networks with one hidden layer as weak learners; all members of a bag train as one batched JAX computation."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import time
from functools import cache
from numbers import Integral
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload.ensembles.adam import AdamState, adam_step
from armload.ensembles.checkpoint import Training, TrainingState, Weights
from armload.ensembles.compiled import CompiledNetworks
from armload.ensembles.progress import Progress, Report
from armload.ensembles.weak_learner import INITIAL_WEIGHTS, SHUFFLE, Bag, Fitted, Learner, Scaling
from armload.errors import ModelError
from armload.runtime.interruption import put_off

_CHUNK = 2000  # validation rows evaluated at once: bounds the memory of the hidden layers
_SAVE_EVERY = 10.0  # [s] between checkpoints


class NetworkLearner(Learner):
    """One hidden layer of ReLU units trained with Adam on the mean squared error (Taie et al. 2024, Section IV).

    The paper states 500 units and at most 1000 epochs; optimiser, batch and stopping rule are our choice. Training of a
    member stops as soon as `patience` epochs together lowered its best validation loss by less than `tolerance`
    (relative); the weights of its best epoch are kept. On one kind of machine the result depends on the seed only.

    Args:
        hidden: units of the hidden layer.
        batch: rows per gradient step.
        max_epochs: passes over the member's rows, at most.
        learning_rate: step of Adam (β₁ = 0.9, β₂ = 0.999, ε = 1e-8).
        patience: epochs the stopping rule looks back.
        tolerance: relative improvement over `patience` epochs below which training stops.
    """

    kind = "network"
    validates = True

    def __init__(
        self,
        hidden: int = 500,
        batch: int = 200,
        max_epochs: int = 1000,
        learning_rate: float = 1e-3,
        patience: int = 10,
        tolerance: float = 1e-4,
    ) -> None:
        self.hidden = hidden
        self.batch = batch
        self.max_epochs = max_epochs
        self.learning_rate = learning_rate
        self.patience = patience
        self.tolerance = tolerance

    def fit_bag(self, bag: Bag, report: Report, checkpoint: Path | None = None) -> Fitted:
        """Train one network per member of the bag, from the checkpoint on if there is one.

        Raises:
            ModelError: a setting out of range, a checkpoint that belongs to another training or cannot be read, or a
                training that diverged.
        """
        for name in ("hidden", "batch", "max_epochs", "patience"):
            given = getattr(self, name)
            if not isinstance(given, Integral) or given < 1:
                raise ModelError(f"{name} is {given!r}: expected a whole number of at least 1")
        if not self.learning_rate > 0.0:
            raise ModelError(f"learning_rate is {self.learning_rate!r}: expected a number above 0")
        data = _Rows.of(bag)
        key = self._key(bag) if checkpoint else ""
        state = TrainingState.load(checkpoint, key) if checkpoint and checkpoint.exists() else self._start(data)
        epoch_function, loss_function = _functions()
        saved = time.monotonic()
        try:
            while len(state.active) and state.epoch < self.max_epochs:
                rows, weight = self._batches(data, state, bag.seed)
                rate = np.float32(self.learning_rate)
                with put_off():
                    training = epoch_function(state.training, data.X, data.y, rows, weight, rate)
                    parts = np.asarray(loss_function(training[0], *data.validation(state.active)), dtype=float)
                    state = self._after_epoch(state, training, parts.sum(axis=0))
                best = np.nanmin(state.losses[-1]) if np.isfinite(state.losses[-1]).any() else np.nan
                note = f"{len(state.active)} of {len(state.epochs)} still training, validation loss {best:.3g}"
                report(Progress("networks", state.epoch, self.max_epochs, note))
                if checkpoint and time.monotonic() - saved > _SAVE_EVERY:
                    state.save(checkpoint, key)
                    saved = time.monotonic()
        finally:  # also when interrupted: what is saved is always a whole number of epochs
            if checkpoint:
                state.save(checkpoint, key)
        if not np.all(np.isfinite(state.best_loss)):
            lost = int(np.argmin(np.isfinite(state.best_loss)))
            raise ModelError(
                f"network training diverged: the validation loss of member {lost} was never a finite number; "
                "scale the data (scale='standard') or lower learning_rate"
            )
        return Fitted(_fold(state.best, bag.scaling), state.epochs, np.array(state.losses))

    # ------------------------------------------------------------------ one epoch

    def _start(self, data: _Rows) -> TrainingState:
        members, d, k, h = len(data.rows), data.X.shape[1], data.y.shape[1], self.hidden
        drawn = []
        for m in range(members):  # Glorot & Bengio 2010: uniform, bound √(6 / (fan in + fan out))
            rng = np.random.default_rng([data.seed, m, INITIAL_WEIGHTS])
            a, b = np.sqrt(6 / (d + h)), np.sqrt(6 / (h + k))
            drawn.append((rng.uniform(-a, a, (d, h)), np.zeros(h), rng.uniform(-b, b, (h, k)), np.zeros(k)))
        weights = Weights(*(np.array(part, dtype=np.float32) for part in zip(*drawn, strict=True)))
        zeros = Weights(*(np.zeros_like(w) for w in weights))
        return TrainingState(
            0,
            np.arange(members),
            (weights, zeros, zeros, np.float32(0)),
            Weights(*(w.copy() for w in weights)),
            np.full(members, np.inf),
            np.zeros(members, dtype=np.int64),
            [],
        )

    def _batches(self, data: _Rows, state: TrainingState, seed: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Rows (steps, M, batch) of one epoch, in each member's order; weights (steps, batch) that blank padding."""
        n = data.rows.shape[1]
        batch = min(self.batch, n)
        steps = -(-n // batch)
        rows = np.zeros((len(state.active), steps * batch), dtype=np.int32)
        for i, m in enumerate(state.active):
            rows[i, :n] = np.random.default_rng([seed, m, SHUFFLE, state.epoch]).permutation(data.rows[m])
        weight = (np.arange(steps * batch) < n).astype(np.float32)
        return np.ascontiguousarray(rows.reshape(-1, steps, batch).swapaxes(0, 1)), weight.reshape(steps, batch)

    def _after_epoch(self, state: TrainingState, training: Training, loss: NDArray[np.float64]) -> TrainingState:
        """The next state: losses of the active members noted, best weights kept, members that are done dropped.

        A new object, so that an interrupt at any point leaves the old state whole.
        """
        row = np.full(len(state.epochs), np.nan)
        row[state.active] = loss
        losses, epochs, best_loss = [*state.losses, row], state.epochs.copy(), state.best_loss.copy()
        epochs[state.active] = state.epoch + 1
        better = np.flatnonzero(np.where(np.isfinite(loss), loss, np.inf) < best_loss[state.active])
        best = Weights(*(kept.copy() for kept in state.best))
        for kept, now in zip(best, training[0], strict=True):
            kept[state.active[better]] = np.asarray(now)[better]
        best_loss[state.active[better]] = loss[better]
        history, active = np.array(losses), state.active
        going = [i for i, m in enumerate(active) if not plateaued(history[:, m], self.patience, self.tolerance)]
        if len(going) < len(active):
            weights, first, second = (Weights(*(np.asarray(a)[going] for a in w)) for w in training[:3])
            training, active = (weights, first, second, training[3]), active[going]
        return TrainingState(state.epoch + 1, active, training, best, best_loss, epochs, losses)

    def _key(self, bag: Bag) -> str:
        """SHA-256 of everything the training depends on."""
        digest = hashlib.sha256(json.dumps([self.get_params(), bag.seed], sort_keys=True).encode())
        for array in (bag.X, bag.y, bag.rows, bag.X_val, bag.y_val, bag.rows_val, *bag.scaling):
            digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def plateaued(losses: NDArray[np.float64], patience: int, tolerance: float) -> bool:
    """Whether the last `patience` epochs lowered the best loss by less than `tolerance`, relative to the best before.

    A loss that is not finite counts as infinitely bad.

    >>> plateaued(np.array([1.0, 0.5, 0.49999]), patience=1, tolerance=1e-4)
    True
    """
    if len(losses) <= patience:
        return False
    losses = np.where(np.isfinite(losses), losses, np.inf)
    before = losses[:-patience].min()
    return not losses.min() <= before * (1.0 - tolerance) or not np.isfinite(losses.min())


@cache
def _functions() -> tuple[Any, Any]:
    """The two compiled computations: an epoch of Adam steps, and the validation loss. JAX is imported here."""
    # On one thread an epoch takes a tenth longer, and its sums do not depend on how many cores there are.
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
    # JAX remarks on every GPU it sees and was not built for; these networks are small enough for a processor.
    logging.getLogger("jax._src.xla_bridge").setLevel(logging.ERROR)
    import jax
    import jax.numpy as jnp

    def squared_error(weights: Weights, x: Any, y: Any) -> Any:  # one member: (rows,)
        error = jax.nn.relu(x @ weights.W1 + weights.b1) @ weights.W2 + weights.b2 - y
        return jnp.mean(error * error, axis=1)

    def batch_loss(weights: Weights, x: Any, y: Any, weight: Any) -> Any:
        return jnp.sum(weight * squared_error(weights, x, y)) / jnp.sum(weight)

    gradients = jax.vmap(jax.grad(batch_loss), in_axes=(0, 0, 0, None))

    @jax.jit
    def epoch(training: Any, X: Any, y: Any, rows: Any, weight: Any, rate: Any) -> Any:
        def step(carry: Any, drawn: Any) -> tuple[Any, None]:
            chosen, blank = drawn
            return tuple(adam_step(AdamState(*carry), gradients(carry[0], X[chosen], y[chosen], blank), rate)), None

        return jax.lax.scan(step, training, (rows, weight))[0]

    @jax.jit
    def loss(weights: Weights, X: Any, y: Any, share: Any) -> Any:  # (chunks, M), to be summed in double precision
        def chunk(part: Any) -> Any:
            x, target, s = part  # (rows, d), (rows, k), (rows, M)
            errors = jax.vmap(squared_error, in_axes=(0, None, None))(weights, x, target)
            return jnp.sum(s.T * errors, axis=1)

        return jax.lax.map(chunk, (X, y, share))

    return epoch, loss


def _fold(weights: Weights, s: Scaling) -> CompiledNetworks:
    """Networks of the raw features and outputs, from networks of the scaled ones."""
    W1, b1, W2, b2 = (np.asarray(w, dtype=float) for w in weights)
    W1 = W1 * s.per_x[:, None]
    return CompiledNetworks(W1, b1 - s.x_mean @ W1, W2 * s.y_scale, b2 * s.y_scale + s.y_mean)


class _Rows(NamedTuple):
    """A bag in the units and the precision of training."""

    X: NDArray[np.float32]
    y: NDArray[np.float32]
    rows: NDArray[np.int64]
    X_val: NDArray[np.float32]  # (chunks, rows, d), padded
    y_val: NDArray[np.float32]
    share: NDArray[np.float64]  # (chunks, rows, M) how much a validation row weighs for a member; each sums to 1
    seed: int

    @classmethod
    def of(cls, bag: Bag) -> _Rows:
        s = bag.scaling

        def scaled(X: NDArray, y: NDArray) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
            return s.features(X).astype(np.float32), s.outputs(y).astype(np.float32)

        X_val, y_val = scaled(bag.X_val, bag.y_val)
        n = len(X_val)
        # A validation row drawn three times weighs three times; drawing is a set of weights on shared rows.
        share = np.array([np.bincount(drawn, minlength=n) for drawn in bag.rows_val]).T / bag.rows_val.shape[1]
        size = min(_CHUNK, n)
        chunks = -(-n // size)

        def cut(a: NDArray) -> NDArray:
            padded = np.zeros((chunks * size, a.shape[1]), dtype=a.dtype)
            padded[:n] = a
            return padded.reshape(chunks, size, a.shape[1])

        return cls(*scaled(bag.X, bag.y), bag.rows, cut(X_val), cut(y_val), cut(share), bag.seed)

    def validation(self, active: NDArray[np.int64]) -> tuple[NDArray, NDArray, NDArray]:
        return self.X_val, self.y_val, self.share[:, :, active].astype(np.float32)
