"""Oracle of Adam for one number, in the arithmetic of its arguments (float, or mpmath for more digits)."""


def adam_scalar(parameter, gradient_at, steps, rate, beta1, beta2, epsilon, power=0.5):
    """Values after 1, 2, ... steps of Adam with bias correction; gradient_at(parameter) -> gradient."""
    first = second = parameter * 0
    path = []
    for k in range(1, steps + 1):
        gradient = gradient_at(parameter)
        first = beta1 * first + (1 - beta1) * gradient
        second = beta2 * second + (1 - beta2) * gradient**2
        corrected_first = first / (1 - beta1**k)
        corrected_second = second / (1 - beta2**k)
        parameter = parameter - rate * corrected_first / (corrected_second**power + epsilon)
        path.append(parameter)
    return path
