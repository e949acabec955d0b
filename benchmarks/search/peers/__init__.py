"""The methods to compare with, each a function of a case, a budget and a seed."""

from collections.abc import Callable, Mapping

from benchmarks.search.case import Case, Trace
from benchmarks.search.peers.cmaes_peers import lra, warm_start
from benchmarks.search.peers.external import EXTERNAL
from benchmarks.search.peers.kendall import kendall_tau
from benchmarks.search.peers.ladder import ladder_shares, ladder_short, ladder_stall
from benchmarks.search.peers.ours import OURS
from benchmarks.search.peers.pycma import lq, noise_handler, pycma
from benchmarks.search.peers.turbo import turbo

Peer = Callable[[Case, float, int], Trace]

PEERS: Mapping[str, Peer] = {
    "pycma": pycma,
    "lq": lq,
    "noise-handler": noise_handler,
    "lra": lra,
    "warm-start": warm_start,
    "ladder-stall": ladder_stall,
    "ladder-shares": ladder_shares,
    "ladder-short": ladder_short,
    "kendall-tau": kendall_tau,
    "turbo": turbo,
    **EXTERNAL,
    **OURS,
}
