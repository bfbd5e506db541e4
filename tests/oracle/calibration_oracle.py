"""Equation (7) for valid views."""


def view_median_weight(pairs, ratio):
    values = sorted(lap / rgb for rgb, lap in pairs)
    middle = len(values) // 2
    median = values[middle] if len(values) % 2 else (values[middle - 1] + values[middle]) / 2
    return ratio / median
