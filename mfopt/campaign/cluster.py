"""Workers of a Dask cluster, as an executor."""

import concurrent.futures as cf
import contextlib
import logging
from collections.abc import Callable
from typing import Any

from mfopt.errors import ConfigError, SimulationError

CONNECT_S = 10.0  # [s] to wait for the scheduler's answer
FETCH_S = 600.0  # [s] for the result of a run that has ended
CLOSE_S = 2.0  # [s] to take leave of a scheduler that may be gone


def dask_cluster(address: str) -> Callable[[], cf.Executor]:
    """Workers of the Dask scheduler at `address`, e.g. `tcp://10.0.0.1:8786`.

    Raises:
        ConfigError: if Dask is missing, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ConfigError(
            "a scheduler needs Dask; from mfopt's folder: pip install '.[cluster]'"
        ) from error

    def make() -> cf.Executor:
        try:
            client = Client(address, timeout=CONNECT_S)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise ConfigError(f"no Dask scheduler answers at {address}: {error}") from error
        return Cluster(client, address)

    return make


class Cluster(cf.Executor):
    """Futures of `concurrent.futures` for those of a Dask client.

    Where the scheduler is lost, they raise SimulationError: Dask's own executor leaves a future
    without an end when the result is lost on its way.
    """

    def __init__(self, client: Any, address: str) -> None:
        self._client = client
        self._address = address

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> cf.Future[Any]:
        """Run a function on a worker.

        Raises:
            SimulationError: if the scheduler is gone.
        """
        ours: cf.Future[Any] = cf.Future()
        try:
            theirs = self._client.submit(fn, *args, pure=False, **kwargs)
            theirs.add_done_callback(lambda done: self._pass_on(done, ours))
        except Exception as error:
            if self._client.status == "running":
                raise
            raise self._gone() from error
        ours.set_running_or_notify_cancel()
        return ours

    def _pass_on(self, theirs: Any, ours: cf.Future[Any]) -> None:
        try:
            ours.set_result(theirs.result(timeout=FETCH_S))
        except (cf.CancelledError, OSError, TimeoutError):
            ours.set_exception(self._gone())
        except BaseException as error:
            ours.set_exception(error)

    def _gone(self) -> SimulationError:
        return SimulationError(
            f"the Dask scheduler at {self._address} is gone, and the runs that were out are lost; "
            "start the cluster again and continue with --resume"
        )

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take leave of the scheduler, which then drops what is not running."""
        log = logging.getLogger("distributed.client")  # tells at length that it is interrupted
        usual = log.level
        log.setLevel(logging.CRITICAL)
        try:
            with contextlib.suppress(OSError, TimeoutError, RuntimeError):
                self._client.close(timeout=CLOSE_S)
        finally:
            log.setLevel(usual)
