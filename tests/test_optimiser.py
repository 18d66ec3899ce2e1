import pytest
import torch
from torch import nn

from lfcore.training.optimiser import MuonAdam, orthogonalised


@pytest.mark.parametrize("shape", [(20, 60), (60, 20)])
def test_singular_values_are_brought_near_one_and_their_directions_kept(shape: tuple[int, int]) -> None:
    generator = torch.Generator().manual_seed(1)
    left, _ = torch.linalg.qr(torch.randn(shape[0], 20, generator=generator))
    right, _ = torch.linalg.qr(torch.randn(shape[1], 20, generator=generator))
    matrix = left * torch.logspace(0, -1.5, 20) @ right.T  # singular values from 1 to 0.03
    found = orthogonalised(matrix)
    values = torch.linalg.svdvals(found)[:20]
    assert float(values.min()) > 0.5 and float(values.max()) < 1.3
    in_its_directions = torch.diag(left.T @ found @ right)
    torch.testing.assert_close(in_its_directions.sort().values, values.sort().values, atol=1e-4, rtol=1e-4)


def test_small_parameters_take_adams_steps() -> None:
    ours, theirs = nn.Linear(5, 3), nn.Linear(5, 3)
    theirs.load_state_dict(ours.state_dict())
    pairs = [(ours, MuonAdam(ours.parameters(), 0.01)), (theirs, torch.optim.Adam(theirs.parameters(), lr=0.01))]
    for k in range(5):
        x = torch.randn(4, 5, generator=torch.Generator().manual_seed(k))
        for model, optimiser in pairs:
            optimiser.zero_grad()
            model(x).square().mean().backward()
            optimiser.step()
    for a, b in zip(ours.parameters(), theirs.parameters(), strict=True):
        torch.testing.assert_close(a, b, atol=1e-6, rtol=1e-5)
