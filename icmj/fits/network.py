"""Networks of bayesflow: imported when first asked for, trained from a seed, kept as plain arrays.

bayesflow is an optional extra (``fit``). It runs on Keras, with JAX underneath unless ``KERAS_BACKEND`` says otherwise.
"""

from __future__ import annotations

import logging
import os
import random
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from icmj.base.array import Array
from icmj.base.text import one_line
from icmj.errors import FitError

Tell = Callable[[str, float], None]
Rows = Callable[[np.random.Generator], tuple[Array, Array]]
"""Targets (n, p) and conditions (n, c) of one epoch."""

_BATCH, _PATIENCE, _RATE = 128, 12, 2e-3
_WIDTHS = (64, 64)
_DEEPEST = 100  # layers of a flow


def library() -> Any:
    """The module bayesflow.

    Raises:
        FitError: if it is not installed, or cannot be imported.
    """
    os.environ.setdefault("KERAS_BACKEND", "jax")
    os.environ.setdefault("JAX_PLATFORMS", "cpu")  # small networks; no other device is looked for
    quiet, root = logging.NullHandler(), logging.getLogger()
    root.addHandler(quiet)  # or bayesflow sets logging up for the whole process
    try:
        with _restore_random():
            import bayesflow
    except ImportError as error:
        raise FitError(f"fitting needs bayesflow ({error}); in a checkout: pip install -e '.[fit]'") from error
    finally:
        root.removeHandler(quiet)
    logging.getLogger("bayesflow").setLevel(logging.WARNING)
    return bayesflow


@dataclass(frozen=True, eq=False)
class Network:
    """A network by its sizes and weights.

    Attributes:
        kind: ``flow``, a density of p targets given c conditions, or ``classifier``, of p classes.
        targets, conditions: p and c.
        depth: layers of a flow, each a pair of affine couplings.
        weights: in the order in which bayesflow makes them.
        losses: mean loss on held-out rows after each epoch; that of the weights is the least.
        temperature: standard deviation of a flow's normal variables, one as it was trained.
    """

    kind: Literal["flow", "classifier"]
    targets: int
    conditions: int
    depth: int
    weights: tuple[Array, ...]
    losses: Array
    temperature: float = 1.0

    def invert(self, normal: Array, conditions: Array) -> Array:
        """Targets (n, p) that a flow makes of standard normal variables (n, p) under conditions (n, c)."""
        found = self._net(np.float32(self.temperature * normal), conditions=np.float32(conditions), inverse=True)
        return np.asarray(found, dtype=float)

    def log_density(self, targets: Array, conditions: Array) -> Array:
        """Logarithm of a flow's density at targets (n, p) under conditions (n, c), shape (n,)."""
        latent, found = self._net(np.float32(targets), conditions=np.float32(conditions), density=True)
        u, T = np.asarray(latent, dtype=float), self.temperature
        change = 0.5 * (1 - 1 / T**2) * np.sum(u**2, axis=1) - self.targets * np.log(T)
        return np.asarray(np.asarray(found, dtype=float) + change)

    def temper(self, targets: Array, conditions: Array) -> Network:
        """A flow with the temperature under which targets that it was not trained on are most probable.

        Of such targets a flow that is too certain makes normal variables of a variance above one.
        """
        latent, _ = self._net(np.float32(targets), conditions=np.float32(conditions), density=True)
        return replace(self, temperature=float(np.sqrt(np.mean(np.asarray(latent, dtype=float) ** 2))))

    def scaled(self, factor: float) -> Network:
        """A flow with its temperature times ``factor``."""
        return replace(self, temperature=factor * self.temperature)

    def logits(self, conditions: Array) -> Array:
        """The logits of a classifier for conditions (n, c), shape (n, p)."""
        found = self._net(xz=None, conditions=np.float32(conditions))
        return np.asarray(found["cross_entropy"]["logits"], dtype=float)

    @cached_property
    def _net(self) -> Any:
        with _restore_random():
            approximator = _build(self.kind, self.targets, self.conditions, self.depth)
        approximator.set_weights(list(self.weights))
        return approximator.inference_network

    def arrays(self) -> dict[str, Array]:
        """Its weights and losses by name."""
        return {**{f"weight{i}": weight for i, weight in enumerate(self.weights)}, "losses": self.losses}

    def head(self) -> dict[str, Any]:
        """Its kind and sizes."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("weights", "losses")}

    @classmethod
    def of(cls, head: Mapping[str, Any], arrays: Mapping[str, Array], targets: int, conditions: int) -> Network:
        """The network that :meth:`head` and :meth:`arrays` are of, with so many targets and conditions.

        Raises:
            ValueError, KeyError, TypeError: if they are of none, or of one of other sizes.
        """
        weights = tuple(arrays[f"weight{i}"] for i in range(sum(name.startswith("weight") for name in arrays)))
        network = cls(**head, weights=weights, losses=arrays["losses"])
        if (network.targets, network.conditions) != (targets, conditions):
            raise ValueError(f"a network of other sizes than {targets} targets and {conditions} conditions")
        if type(network.depth) is not int or not 1 <= network.depth <= _DEEPEST:
            raise ValueError(f"a network of depth {one_line(network.depth, 40)}")
        if not (isinstance(network.temperature, float) and 0 < network.temperature < np.inf):
            raise ValueError(f"a network of temperature {one_line(network.temperature, 40)}")
        if not all(weight.dtype.kind in "fiub" and np.isfinite(weight).all() for weight in weights):
            raise ValueError("a network with weights that are not finite numbers")
        assert network._net is not None  # sets the weights, if they fit
        return network


def train(
    kind: Literal["flow", "classifier"],
    rows: Rows,
    held_out: tuple[Array, Array],
    seed: int,
    *,
    epochs: int,
    depth: int = 3,
    progress: Tell | None = None,
) -> Network:
    """Train a network until held-out rows say that it learns no more; the same seed gives the same weights.

    Args:
        kind: of network.
        rows: makes those of an epoch.
        held_out: targets and conditions by which it is judged.
        seed: of weights, order and whatever ``rows`` draws.
        epochs: at most.
        depth: layers of a flow.
        progress: called with the fraction of epochs done.

    Raises:
        FitError: if bayesflow is missing, or the training diverges.
    """
    library()
    import keras

    p, c = held_out[0].shape[1], held_out[1].shape[1]
    generator = np.random.default_rng((seed, 2))

    class Epoch(keras.utils.PyDataset):
        def __init__(self, made: Callable[[], tuple[Array, Array]] | None) -> None:
            super().__init__()
            self._made = made
            self._rows = held_out if made is None else made()
            self._size = min(_BATCH, len(self._rows[0]))

        def __len__(self) -> int:
            return len(self._rows[0]) // self._size  # the rest is left out: it would be compiled once more

        def __getitem__(self, i: int) -> dict[str, Any]:
            part = slice(i * self._size, (i + 1) * self._size)
            return {
                "inference_variables": np.float32(self._rows[0][part]),
                "inference_conditions": np.float32(self._rows[1][part]),
            }

        def on_epoch_end(self) -> None:
            if self._made is not None:
                self._rows = self._made()

    def shuffled() -> tuple[Array, Array]:
        targets, conditions = rows(generator)
        order = generator.permutation(len(targets))
        return targets[order], conditions[order]

    class Told(keras.callbacks.Callback):
        def on_epoch_end(self, epoch: int, logs: Any = None) -> None:
            if progress is not None:
                progress("training", (epoch + 1) / epochs)

    with _seed_keras(seed):
        approximator = _build(kind, p, c, depth)
        data = Epoch(shuffled)
        rate = keras.optimizers.schedules.CosineDecay(_RATE, max(epochs * len(data), 1), alpha=0.02)
        approximator.compile(optimizer=keras.optimizers.AdamW(rate, weight_decay=1e-3, clipnorm=1.0))
        stop = keras.callbacks.EarlyStopping("val_loss", patience=_PATIENCE, restore_best_weights=True)
        history = approximator.fit(
            dataset=data, validation_data=Epoch(None), epochs=epochs, verbose=0, callbacks=[stop, Told()]
        )
    losses = np.asarray(history.history["val_loss"], dtype=float)
    weights = tuple(np.asarray(weight) for weight in approximator.get_weights())
    if not np.isfinite(losses).any() or not all(np.isfinite(weight).all() for weight in weights):
        raise FitError("the training of the network diverged; are summaries or numbers constant, or infinite?")
    return Network(kind, p, c, depth, weights, losses)


def _build(kind: str, p: int, c: int, depth: int) -> Any:
    bayesflow = library()
    inner = {"widths": _WIDTHS, "activation": "silu"}
    if kind == "flow":
        flow = bayesflow.networks.CouplingFlow(depth=depth, transform="affine", subnet_kwargs=inner)
        made = bayesflow.approximators.ContinuousApproximator(inference_network=flow, standardize=None)
    else:
        made = bayesflow.approximators.ModelComparisonApproximator(
            num_models=p, classifier_network=bayesflow.networks.MLP(**inner)
        )
    made.build({"inference_variables": (_BATCH, p), "inference_conditions": (_BATCH, c)})
    return made


@contextmanager
def _seed_keras(seed: int) -> Iterator[None]:
    """Keras' own seed, and with it those of Python and NumPy, which are put back."""
    import keras

    with _restore_random():
        keras.utils.set_random_seed(seed)
        yield


@contextmanager
def _restore_random() -> Iterator[None]:
    """Leave the random numbers of Python and NumPy as they are: Keras draws from them, even when it is imported."""
    python, numpy = random.getstate(), np.random.get_state()  # noqa: NPY002 (Keras seeds it)
    try:
        yield
    finally:
        random.setstate(python)
        np.random.set_state(numpy)  # noqa: NPY002
