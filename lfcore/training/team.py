"""Several processes that train one model together, by PyTorch's DistributedDataParallel; `torchrun` starts them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
import torch.distributed as dist
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel


@dataclass(frozen=True)
class Team:
    """This process's place among those that train together."""

    rank: int = 0
    size: int = 1

    @property
    def leads(self) -> bool:
        """Whether this process is the one that validates, writes and reports."""
        return self.rank == 0

    def numbers(self, count: int) -> range:
        """Which of `count` things, numbered over the whole team from 0, are this process's."""
        return range(self.rank, count, self.size)

    def share(self, module: nn.Module) -> nn.Module:
        """The module, with gradients averaged over the team."""
        return module if self.size == 1 else DistributedDataParallel(module)

    def any(self, flag: bool) -> bool:
        """Whether the flag holds in any process; all must ask at the same step."""
        return bool(-self.least(-float(flag)))

    def least(self, number: float) -> float:
        """The least of the numbers of all processes; all must ask at the same step."""
        if self.size == 1:
            return number
        numbers = torch.tensor(float(number), device="cuda" if dist.get_backend() == "nccl" else "cpu")
        dist.all_reduce(numbers, dist.ReduceOp.MIN)
        return float(numbers)

    def agree(self, tensor: Tensor) -> Tensor:
        """The first process's tensor, in all of them; all must ask at the same step."""
        if self.size > 1:
            tensor = tensor.contiguous()
            dist.broadcast(tensor, 0)
        return tensor

    def wait(self) -> None:
        """Until all have come here."""
        if self.size > 1:
            dist.barrier()


ALONE = Team()


@contextmanager
def join_team(device: str) -> Iterator[Team]:
    """The team that `torchrun` started this process in (its environment says so), else ALONE. device: cpu, cuda or auto."""
    size = int(os.environ.get("WORLD_SIZE", "1"))
    if size == 1:
        yield ALONE
        return
    on_gpu = device != "cpu" and torch.cuda.is_available()
    if on_gpu:
        torch.cuda.set_device(int(os.environ.get("LOCAL_RANK", "0")))
    dist.init_process_group("nccl" if on_gpu else "gloo")
    try:
        yield Team(dist.get_rank(), size)
    finally:
        dist.destroy_process_group()
