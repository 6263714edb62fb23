"""Installing the engine's callbacks: always restored, nested, shared between threads."""

import threading

import mujoco
import pytest
from patience import PATIENCE

from icmj.engine.native.field import callbacks
from icmj.engine.safety import install_callbacks


def now() -> tuple[object, object]:
    return mujoco.get_mjcb_control(), mujoco.get_mjcb_act_dyn()


def one(model: mujoco.MjModel, data: mujoco.MjData) -> None: ...


def two(model: mujoco.MjModel, data: mujoco.MjData) -> None: ...


def test_callbacks_are_removed_whatever_happens() -> None:
    with install_callbacks(one):
        assert now() == (one, None)
    assert now() == (None, None)
    with pytest.raises(ZeroDivisionError), install_callbacks(one):
        raise ZeroDivisionError
    assert now() == (None, None)
    with pytest.raises(TypeError), install_callbacks(3):  # type: ignore[arg-type]
        pass
    with pytest.raises(TypeError), install_callbacks(one, 3):  # type: ignore[arg-type]
        pass
    assert now() == (None, None)


def test_blocks_nest_and_put_back_what_was_there() -> None:
    mujoco.set_mjcb_control(two)
    try:
        with install_callbacks(*callbacks()):
            assert now()[0] is callbacks()[0]
            with install_callbacks():
                assert now() == (None, None)
                with install_callbacks(one):
                    assert now() == (one, None)
            assert now()[0] is callbacks()[0]
            with install_callbacks(*callbacks()):
                assert now()[1] is callbacks()[1]
            assert now()[1] is callbacks()[1]
        assert now() == (two, None)
    finally:
        mujoco.set_mjcb_control(None)


def test_threads_share_the_same_callbacks_until_the_last_leaves() -> None:
    inside, leave_first, leave_second = threading.Barrier(3), threading.Event(), threading.Event()

    def work(leave: threading.Event) -> None:
        with install_callbacks(*callbacks()):
            inside.wait(PATIENCE)
            leave.wait(PATIENCE)

    threads = [threading.Thread(target=work, args=(event,)) for event in (leave_first, leave_second)]
    for thread in threads:
        thread.start()
    inside.wait(PATIENCE)
    leave_first.set()
    threads[0].join(PATIENCE)
    assert now()[0] is callbacks()[0]
    leave_second.set()
    threads[1].join(PATIENCE)
    assert now() == (None, None)


def test_other_callbacks_wait_for_other_threads() -> None:
    order: list[str] = []
    inside, leave = threading.Event(), threading.Event()

    def first() -> None:
        with install_callbacks(one):
            inside.set()
            leave.wait(PATIENCE)
            assert now()[0] is one
            order.append("first leaves")

    def second() -> None:
        inside.wait(PATIENCE)
        with install_callbacks(two):
            order.append("second enters")
            assert now()[0] is two

    threads = [threading.Thread(target=work) for work in (first, second)]
    for thread in threads:
        thread.start()
    inside.wait(PATIENCE)
    threads[1].join(0.2)
    assert order == []
    leave.set()
    for thread in threads:
        thread.join(PATIENCE)
    assert order == ["first leaves", "second enters"]
    assert now() == (None, None)
