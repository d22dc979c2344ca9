import time

import numpy as np
import pytest

from shadowbench.counters import ALL_COUNTERS, COUNTERS
from shadowbench.probe import Probe


def test_counter_names_are_unique_and_defined():
    assert len(COUNTERS) == len(ALL_COUNTERS)
    for counter in ALL_COUNTERS:
        assert counter.name.replace("_", "").isalnum() and counter.name == counter.name.lower()
        assert counter.definition.endswith(".") and counter.unit and counter.source


def test_test_and_set_is_part_of_all_work():
    assert all(counter.in_all_work for counter in ALL_COUNTERS if counter.in_test_and_set)


def test_totals_follow_the_registry():
    probe = Probe(counting=True)
    probe.count("node_tests", 32)
    probe.count("node_tests", np.int64(32))
    probe.count("sample_tests", 5)
    probe.count("map_texels_read", 7)
    assert probe.all_counts() == {"all_work": 76, "map_texels_read": 7, "node_tests": 64, "sample_tests": 5,
                                  "test_and_set": 69}


def test_timing_probe_keeps_no_counts():
    probe = Probe()
    probe.count("node_tests", 32)
    probe.count_samples(np.ones(4, np.int64))
    assert probe.counts == {} and probe.heat is None


@pytest.mark.parametrize(("name", "value"), [("nodetests", 1), ("test_and_set", 1), ("node_tests", -1),
                                             ("node_tests", 1.5), ("node_tests", True + 0.0)])
def test_bad_counts_are_refused(name, value):
    with pytest.raises(ValueError, match=name):
        Probe(counting=True).count(name, value)


def test_levels_add_up_to_the_total():
    probe = Probe(counting=True)
    probe.count_levels("node_tests", np.array([32, 64, 96]))
    assert probe.levels == {"node_tests": [32, 64, 96]} and probe.counts == {"node_tests": 192}


def test_stage_times_add_up():
    probe = Probe()
    for _ in range(2):
        with probe.stage("wait"):
            time.sleep(0.01)
    assert 0.02 <= probe.stages["wait"] < 1.0


def test_heat_maps_of_two_stages_add_up():
    probe = Probe(counting=True)
    probe.count_samples(np.array([1, 2]))
    probe.count_samples(np.array([10, 20]))
    assert probe.heat.tolist() == [11, 22]
