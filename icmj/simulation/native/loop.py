"""The loop: a run of any controller over any flow, from instant to instant. There is no other.

Between two instants at which something is due a *flow* moves plant and controller, and finds the first crossing of the
event rule, or of a guard, on the way. At the instant the loop does what is due, always in this order, each on the state
that the one before has left:

1. what acts changes: pushes, disturbances and errors of readings begin, bend or end, with the values from the right; a
   set-point that jumps moves the controller's state, and an impulse moves what it acts on;
2. actions that are due, the oldest first: a := G a; and resets of a period: a := J a;
3. the clock ticks, or the sample is taken for which the rule has reached its threshold; then the rule, if it is watched
   and has reached its threshold: an event, one with the tick. If 1 or 2 has moved the state, the rule is judged anew.
   Guards of a controller that has modes are looked at with the rule; what they meet where something else is due is
   found where the next stretch begins, at the same instant, on what the tick has left;
4. rows and events are recorded, with the state before the reset;
5. the event: a := J a, the mode that follows; its action is due one delay later, and the rule is watched again when the
   least interval is over;
6. the ends: the plant has fallen, there were as many events as were asked for, or the run is over.

Instants are compared in seconds, never as fractions of a step, which are rounded; those within :data:`ONE_INSTANT` of
each other are one, because sums of intervals are rounded, too. What is reached less than that before an instant at
which something is due is reached there, after it. A rule that is watched from an instant on is judged at that instant.
Every number that decides is a function of state and time alone, so neither the rows asked for nor the size of a buffer
changes a bit of the motion, but where a step would not find room for its rows.

A flow is a module with the verbs below, which the loop calls with the flow's own data, whatever these are. Any
controller goes by stretches (:mod:`icmj.linear.native.stretches`, :mod:`icmj.engine.native.stretches`, and for both
:mod:`icmj.simulation.native.taps`). Quicker is, on the linear plant, what is for an observer with a hold and an event
rule (:mod:`icmj.linear.native.pieces`), and in MuJoCo, with the same data, what goes from step to step under a
controller that reads the current outputs alone (:mod:`icmj.engine.native.steps`).

===================== ==================================================================================================
``travel(f)``         moves to the next instant, or a step towards it: :data:`ARRIVED` where the others are to be
                      called, a :class:`Status` that ends the run, or ``RUNNING`` where the caller is asked, for room or
                      whether to go on
``change(f)``         1; whether the state, or a reading, has jumped
``act(f)``            2; whether anything has acted
``tick(f)``           whether an event is due by itself
``cross(f, moved)``   whether what has been reached is an event; changes the mode where a guard does
``note(f, e, acted)`` 4, of an event where ``e``
``fire(f)``           5
``end(f, e)``         6: a :class:`Status`, ``RUNNING`` to go on
===================== ==================================================================================================

What the controller has planned (*agenda*) is the same for all flows. Its arguments are ``plan``, anything with
``wait``, ``delay``, ``clock`` and ``sampling`` [s], and ``now``, anything with the arrays

- ``when``: :data:`READY`, from when the rule is watched; :data:`SAMPLE`, when a sample is taken; :data:`LAST`, the last
  event [s];
- ``due``: numbers of the next :data:`EDGE` of what acts and :data:`TICK` of the clock, and of actions that have been
  carried out (:data:`ACTED`) and planned (:data:`PLANNED`); of stretches also of the next :data:`RESET` of a period and
  :data:`SIGNAL` of the controller's own signals;
- ``queue``: times of actions, in a ring [s].
"""

from __future__ import annotations

from enum import IntEnum
from functools import cache
from pathlib import Path

import numpy as np

from icmj.base.compilation import hash_contents, inlined, merged
from icmj.base.instants import ONE_INSTANT, one


class Status(IntEnum):
    """Why the loop came back."""

    FULL = -1
    """There is no room for what the controller remembers: call again with more."""
    RUNNING = 0
    """A buffer is full, or it has worked for a while: call again."""
    COMPLETED = 1
    FELL = 2
    DIVERGED = 3
    WARNED = 4
    """The engine did."""
    REACHED = 5
    """As many events as were asked for."""
    STALLED = 6
    """The modes of the controller switch to and fro at one instant."""


ARRIVED = -2  # what a journey comes back with, beside a Status
_RUNNING = int(Status.RUNNING)
READY, SAMPLE, LAST = 0, 1, 2
RESET, EDGE, TICK, ACTED, PLANNED, SIGNAL = 0, 1, 2, 3, 4, 5


@merged
def run_loop(flow, travel, change, act, tick, cross, note, fire, end):  # type: ignore[no-untyped-def]
    """Go on with a run until the caller is asked or the run ends; a :class:`Status`."""
    while True:
        status = travel(flow)
        if status != ARRIVED:
            return status
        moved = change(flow)
        acted = act(flow)
        due = tick(flow)
        event = cross(flow, moved or acted) or due
        note(flow, event, acted)
        if event:
            fire(flow)
        status = end(flow, event)
        if status != _RUNNING:
            return status


@inlined
def is_due(instant, t):  # type: ignore[no-untyped-def]
    """Whether the instant is ``t``, or over."""
    return instant <= t + ONE_INSTANT


@inlined
def has_passed(edges, due, t):  # type: ignore[no-untyped-def]
    """Whether the last edge before the one that is due next is at ``t``."""
    return due > 0 and edges[due - 1] >= t - ONE_INSTANT


@inlined
def next_event(plan, now):  # type: ignore[no-untyped-def]
    """When the next event comes by itself [s]: that of the clock, or of the sample that is waited for."""
    return min(now.due[TICK] * plan.clock, now.when[SAMPLE])


@inlined
def next_action(now):  # type: ignore[no-untyped-def]
    """When the oldest action acts that has not acted yet [s]."""
    if now.due[ACTED] == now.due[PLANNED]:
        return np.inf
    return now.queue[now.due[ACTED] % len(now.queue)]


@inlined
def next_instant(plan, now, edge, end):  # type: ignore[no-untyped-def]
    """When something is due next [s], if what acts changes at ``edge`` and the run ends at ``end``.

    Of instants that are one, it is that of the end, of the edge, of the tick.
    """
    edge = one(edge, end)
    tick = one(one(next_event(plan, now), edge), end)
    action = one(one(one(next_action(now), tick), edge), end)
    return min(tick, action, edge, end)


@inlined
def is_watched(now, t):  # type: ignore[no-untyped-def]
    """Whether the event rule is watched at ``t``."""
    return now.when[READY] <= t + ONE_INSTANT


@inlined
def take_action(now, t):  # type: ignore[no-untyped-def]
    """Take the oldest action from the queue if it is due at ``t``; whether it is."""
    due = next_action(now) <= t + ONE_INSTANT
    if due:
        now.due[ACTED] += 1
    return due


@inlined
def await_sample(plan, now, t):  # type: ignore[no-untyped-def]
    """The rule has reached a face at ``t``: whether that is the event, and not the beginning of its sample."""
    if plan.sampling > 0:
        now.when[READY], now.when[SAMPLE] = np.inf, t + plan.sampling
        return False
    return True


@inlined
def plan_after(plan, now, t):  # type: ignore[no-untyped-def]
    """What follows an event at ``t``: its action, the next tick, and when the rule is watched again."""
    if plan.delay > 0:
        now.queue[now.due[PLANNED] % len(now.queue)] = t + plan.delay
        now.due[PLANNED] += 1
    if now.due[TICK] * plan.clock <= t + ONE_INSTANT:
        now.due[TICK] += 1
    now.when[READY], now.when[SAMPLE], now.when[LAST] = t + plan.wait, np.inf, t


@cache
def sources() -> int:
    """A number that changes with the loop and what stands beside it."""
    return hash_contents(Path(__file__).parent)
