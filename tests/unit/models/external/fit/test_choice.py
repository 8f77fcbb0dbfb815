import numpy as np
import pytest

from external_shots import CHANNELS, shot, sweep, transfer
from robid.models.external.fit.choice import choose_structure
from robid.models.external.fit.options import ExternalOptions
from robid.studies.oliveira2019.seeds import draw_plant, find_orders, simulate_plant

Z = transfer(*CHANNELS["Z"], delay=2)


def measured(high_hz, seed, noise=1e-3):
    return shot(Z, sweep(high_hz, 2000), noise=noise, seed=seed)


def test_evidence_finds_order_and_delay():
    choice = choose_structure([measured(5.0, 1)], [0], [0], ExternalOptions(max_poles=3, max_delay_samples=5))
    found = choice.structure
    assert (found.poles, found.zeros, found.delay_samples) == (2, 1, 2)
    assert "2 poles and 1 zero" in choice.reason
    assert "white residuals" in choice.reason
    assert not choice.messages
    best = min(choice.tried, key=lambda each: each.bic)
    assert best.structure == found


def test_the_fewest_that_suffice():
    options = ExternalOptions(rule="sufficient", sufficient_nrmse=0.6, max_poles=3, delay_samples=2)
    held_back = [measured(2.0, 7)]
    choice = choose_structure([measured(5.0, 1)], [0], [0], options, held_back)
    assert choice.structure.poles == 1
    assert choice.best.nrmse >= 0.6
    assert "1 shot held back" in choice.reason
    strict = ExternalOptions(rule="sufficient", sufficient_nrmse=0.993, max_poles=3, delay_samples=2)
    assert choose_structure([measured(5.0, 1)], [0], [0], strict, held_back).structure.poles == 2
    never = ExternalOptions(rule="sufficient", sufficient_nrmse=0.99999, max_poles=2, delay_samples=2)
    assert any("sufficient_nrmse" in each for each in choose_structure([measured(5.0, 1)], [0], [0], never).messages)


def test_a_delay_longer_than_searched_is_told():
    late = shot(transfer(*CHANNELS["Z"], delay=9), sweep(5.0, 2000), noise=1e-3, seed=1)
    choice = choose_structure([late], [0], [0], ExternalOptions(poles=2, zeros=1, max_delay_samples=5))
    assert choice.structure.delay_samples == 5
    assert any("max_delay_samples" in each for each in choice.messages)


def test_a_delay_that_slow_commands_do_not_tell():
    slow = shot(Z, sweep(0.1, 2000, low_hz=0.01), noise=1e-2, seed=3)
    choice = choose_structure([slow], [0], [0], ExternalOptions(max_poles=2, max_delay_samples=4))
    assert any("not determined" in each for each in choice.messages)


def test_without_strong_evidence_fewer_poles_are_taken_at_their_own_delay():
    command = sweep(5.0, 4000)
    close = shot(transfer(*CHANNELS["C"], delay=4, average=4), command, noise=3e-3, seed=6)
    options = ExternalOptions(max_poles=3, max_delay_samples=6, moving_average=4)
    choice = choose_structure([close], [0], [0], options)
    least = min(choice.tried, key=lambda each: each.bic)
    assert least.structure.poles == 3, "by the criterion alone, noise would add a pole"
    found = choice.structure
    assert (found.poles, found.zeros, found.delay_samples) == (2, 1, 4)


def test_orders_of_random_plants():
    true, found = find_orders(range(3))
    assert true[:, 0].tolist() == found[:, 0].tolist()


@pytest.mark.parametrize("seed", range(20))
def test_random_plants_are_what_they_should_be(seed):
    rng = np.random.default_rng(seed)
    plant = draw_plant(rng)
    roots = np.concatenate([plant.poles, plant.zeros])
    assert len(plant.zeros) < len(plant.poles) <= 5
    assert (plant.poles.real < 0).all()
    for one in range(len(roots)):
        for other in range(one):
            assert abs(roots[one] - roots[other]) >= 0.2 * max(abs(roots[one]), abs(roots[other])) * (1 - 1e-9)
    told = simulate_plant(plant, rng).outputs
    assert np.isfinite(told).all()
