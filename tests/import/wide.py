"""Layers of which one row is more than a unit of work, for odd.py."""
import numpy as np

from variants import conv, depthwise, image, like


def wide_images(c):
    """Convolutions of which one row is more than a unit of work: several steps write their columns."""
    kind, width, ic, oc = c.int(0, 3), c.int(150, 400), c.int(20, 40), c.int(60, 130)
    if kind == 0:
        x = image(c, 2, width, ic)
        weights, scales = c.weights((oc, 3, 3, ic), oc, 0)
        y = c.q((c.b.tensors[x][1][0], 4, 2 * width, oc), 0.03 * float(np.mean(scales)) * 3000)
        c.b.op("TRANSPOSE_CONV", [c.b.const("int32", c.b.tensors[y][1]), weights, x], [y], "TransposeConv", StrideH=2, StrideW=2, Padding=0)
        return [x], [y]
    stride = c.int(1, 2)
    x = image(c, c.int(1, 5), stride * (width if kind < 3 else c.choose(width, 640)), ic * (1 if kind < 3 else 8))
    y = conv(c, x, oc, c.int(2, 5) if kind < 3 else 1, stride, activation=c.choose(0, 1, 3))
    if c.int(0, 1):
        return [x], [y]
    s = c.q(c.b.tensors[y][1], 1 / 256, 0 if c.dtype == "uint8" else -128)
    c.b.op("LOGISTIC", [y], [s])
    return [x], [s]


def wide_depthwise(c):
    """Depthwise layers of which one row is more than a unit of work: several steps write their channels, maybe in a joined map."""
    stride = c.int(1, 2)
    x = image(c, 3, stride * c.int(250, 330), 8 * c.int(20, 30))
    y = depthwise(c, x, c.choose(5, 7, 9), stride, activation=c.choose(0, 1, 3))
    if c.int(0, 1):
        return [x], [y]
    shape = c.b.tensors[y][1]
    other, z = like(c, y, (*shape[:3], 8)), like(c, y, (*shape[:3], shape[3] + 8))
    c.b.op("CONCATENATION", [other, y], [z], "Concatenation", Axis=3)
    return [x, other], [z]


def wide_layers(c):
    """Layers of which one row, or one pixel's weights, are more than a unit of work: several steps write their channels."""
    kind = c.int(0, 3)
    oc = c.int(250, 500)
    if kind == 0:
        x, k = c.q((c.int(1, 3), 1500), 0.03), 1500
        weights, scales = c.weights((oc * 4, k), oc * 4, 0)
        y = c.q((c.b.tensors[x][1][0], oc * 4), 0.03 * float(np.mean(scales)) * 60 * np.sqrt(k))
        c.b.op("FULLY_CONNECTED", [x, weights, c.bias(oc * 4, 0.03, scales)], [y], "FullyConnected",
               FusedActivationFunction=c.choose(0, 1, 3))
    elif kind == 1:
        x = c.q((2, 3, 3, 512), 0.03)
        weights, scales = c.weights((oc, 3, 3, 512), oc, 0)
        y = c.q((2, 6, 6, oc), 0.03 * float(np.mean(scales)) * 3000)
        c.b.op("TRANSPOSE_CONV", [c.b.const("int32", [2, 6, 6, oc]), weights, x], [y], "TransposeConv", StrideH=2, StrideW=2, Padding=0)
    else:
        x = image(c, 2, 7, 512)
        y = conv(c, x, oc // 8 * 8, 3, activation=c.choose(0, 1, 3))
    s = c.q(c.b.tensors[y][1], 1 / 256, 0 if c.dtype == "uint8" else -128)
    c.b.op("LOGISTIC", [y], [s])
    if kind < 3:
        return [x], [s]
    z = like(c, s, (1, 2, 7, c.b.tensors[y][1][3] + 8))
    other = like(c, s, (1, 2, 7, 8))
    c.b.op("CONCATENATION", [other, s], [z], "Concatenation", Axis=3)
    return [x, other], [z]
