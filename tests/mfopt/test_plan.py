import numpy as np

from mfopt.search.plan import Plan

A, B = np.array([0.1, 0.2]), np.array([0.3, 0.4])


def test_what_is_planned_counts_as_spent_once() -> None:
    plan = Plan([1.0, 8.0], budget=20.0)
    plan.add(A, 1)
    assert plan.left_after(0) == 11.0
    plan.begin()
    assert plan.left_after(0, runs=3) == 9.0
    np.testing.assert_array_equal(plan.spent, [0.0, 8.0])


def test_runs_begin_in_order_and_are_numbered() -> None:
    plan = Plan([1.0], budget=9.0)
    plan.add(A, 0)
    plan.add(B, 0, awaited=False)
    begun = [plan.begin(), plan.begin()]
    assert [number for number, _ in begun] == [0, 1]
    assert [run.z is z for (_, run), z in zip(begun, (A, B), strict=True)] == [True, True]
    assert not plan


def test_it_waits_for_awaited_runs_alone() -> None:
    plan = Plan([1.0], budget=9.0)
    plan.add(A, 0)
    plan.add(B, 0, awaited=False)
    for _ in range(2):
        plan.begin()
    assert plan.waits
    assert plan.end(0).z is A
    assert not plan.waits


def test_it_need_not_wait_for_what_it_is_told_to_await_no_more() -> None:
    plan = Plan([1.0], budget=9.0)
    plan.add(A, 0)
    plan.begin()
    plan.await_no_more()
    assert not plan.waits
    assert plan.end(0).z is A


def test_designs_that_are_out_are_known_by_level() -> None:
    plan = Plan([1.0, 8.0], budget=20.0)
    plan.add(A, 0)
    plan.add(B, 1)
    for _ in range(2):
        plan.begin()
    (out,) = plan.out_at(1)
    assert out is B
    plan.end(1)
    assert plan.out_at(1) == []


def test_what_is_known_already_is_taken_off_the_plan() -> None:
    plan = Plan([1.0, 8.0], budget=20.0)
    for z, level in ((A, 0), (B, 0), (A, 1)):
        plan.add(z, level)
    plan.drop(A.copy(), 0)
    assert [(run.z is z, run.level) for (_, run), z in zip([plan.begin(), plan.begin()], (B, A),
            strict=True)] == [(True, 0), (True, 1)]  # fmt: skip
    assert not plan
