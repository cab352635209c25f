"""Benches and campaigns in this process: a new one takes seconds to import all."""

import pickle
from concurrent.futures import Future
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import pytest

from firmware_sim import bench
from firmware_sim.campaign import driver
from firmware_sim.fault_campaign import runner


def _submit(function, *arguments):
    future = Future[object]()
    pickle.dumps((function, arguments))  # as what is sent to a process
    try:
        future.set_result(function(*arguments))
    except Exception as error:  # the caller asks for it, as for that of a process
        future.set_exception(error)
    return future


@contextmanager
def in_one_process():
    """What is submitted to a pool is done at once."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (bench, driver, runner):

            def pool(_, common, module=module):
                patch.setattr(module, "shared", lambda: common, raising=False)
                return nullcontext(SimpleNamespace(submit=_submit))

            patch.setattr(module, "WorkerPool", pool)
        yield
