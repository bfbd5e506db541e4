"""Accuracy against time: error relative to the exact renderer, against seconds and visits.

scenes    the rendered scenes                     settings  the measured settings
measure   errors and costs of one setting         study     the whole measurement and its Pareto fronts
budget    the best setting within a budget        text      results as text
results   tradeoff.json, checked                  figure    error against cost as a diagram
page      tradeoff.html
"""
