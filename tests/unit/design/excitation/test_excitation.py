"""The designed reference: RMS, lines, phases and crest factors."""

import time
from dataclasses import replace

import numpy as np
import pytest

from robid.design.excitation.excitation import design_excitation
from robid.design.excitation.options import MultisineOptions
from robid.errors import SettingsError
from two_drives import OPTIONS, STEP


def test_reference_has_the_asked_rms_lines_and_orthogonality():
    excitation = design_excitation(OPTIONS, 2, 3, STEP)
    assert excitation.reference.shape == (3, 2, 1000, 2)
    np.testing.assert_allclose(np.sqrt(np.mean(excitation.reference**2, axis=2)), np.broadcast_to([8, 12], (3, 2, 2)))
    spectrum = np.fft.rfft(excitation.reference, axis=2) / 500
    np.testing.assert_allclose(spectrum[:, :, excitation.excited_lines], excitation.spectrum, atol=1e-10)
    silent = np.setdiff1d(np.arange(501), excitation.excited_lines)
    assert np.abs(spectrum[:, :, silent]).max() < 1e-10
    gram = np.einsum("reki,rekj->rkij", excitation.spectrum, excitation.spectrum.conj())
    assert np.abs(gram[..., 0, 1]).max() < 1e-10 * np.abs(gram[..., 0, 0]).max()


def test_realizations_and_motors_have_their_own_phases():
    spectrum = design_excitation(OPTIONS, 2, 2, STEP).spectrum[:, 0]
    phase = np.angle(spectrum)
    assert np.abs(phase[0] - phase[1]).min(axis=0).max() > 1e-6
    assert np.abs(phase[0, :, 0] - phase[0, :, 1]).max() > 0.1
    again = design_excitation(OPTIONS, 2, 2, STEP).spectrum[:, 0]
    np.testing.assert_array_equal(spectrum, again)


def test_default_excitation_is_flat_enough_and_fast():
    start = time.process_time()
    excitation = design_excitation(MultisineOptions(), 6, 1, STEP)
    assert time.process_time() - start < 5
    assert excitation.crest_factor.max() <= 1.85


def test_random_block_phases_keep_lines_rms_and_orthogonality_and_are_searched():
    options = replace(OPTIONS, random_block_phases=True, phase_iterations=60)
    found = design_excitation(options, 2, 2, STEP)
    block = np.moveaxis(found.spectrum, 1, -1)
    gram = block @ np.swapaxes(block, -1, -2).conj()
    assert np.abs(gram[..., 0, 1]).max() < 1e-12 * np.abs(gram[..., 0, 0]).max()
    np.testing.assert_allclose(np.sqrt(np.mean(found.reference**2, axis=2)), np.broadcast_to([8, 12], (2, 2, 2)))
    drawn = design_excitation(replace(options, phase_iterations=0), 2, 2, STEP)
    assert found.crest_factor.max() < 0.9 * drawn.crest_factor.max()


@pytest.mark.parametrize(("rms", "word"), [((1.0,), "1 values for 2 motors"), ((1.0, -2.0), "motor 2 is not positive")])
def test_rms_that_does_not_fit_is_refused(rms, word):
    with pytest.raises(SettingsError, match=word):
        design_excitation(MultisineOptions(rms=rms), 2, 1, STEP)


def test_fewer_experiments_are_the_first_of_each_block():
    whole = design_excitation(OPTIONS, 2, 3, STEP)
    part = whole.first_experiments(1)
    assert part.reference.shape[:2] == part.spectrum.shape[:2] == part.crest_factor.shape[:2] == (3, 1)
    np.testing.assert_array_equal(part.reference[:, 0], whole.reference[:, 0])
    np.testing.assert_array_equal(whole.first_experiments(None).spectrum, whole.spectrum)
