"""The detector: a small convolutional network with one output grid at an eighth of its input, decoded as YOLOv2 with one anchor.

A first layer that takes every fourth pixel's neighbourhood, an encoder down to 1/64 and a decoder that adds the finer levels back
(as U-Net, Ronneberger et al. 2015, with sums in place of concatenations). Plain 3x3 convolutions with ReLU: on int8 dot-product
instructions they cost less than depthwise ones of the same accuracy."""
import keras
import numpy as np
import tensorflow as tf
from keras import layers

from augment import HEIGHT, STRIDE, WIDTH

EARLY = ("stem", "down8", "block8")  # edges and corners, of use for any picture
ANCHOR_PX = 48.0  # in the input; sizes are exp(t) times this


class Norm(layers.BatchNormalization):
    """Batch normalisation in one operation: Keras' own takes six passes over the tensor, half the time of a training step. Frozen, it
    normalises by what it knows, as Keras' own does."""

    def call(self, x, training=None, mask=None):
        training = training and self.trainable
        scale, offset = tf.cast(self.gamma, tf.float32), tf.cast(self.beta, tf.float32)
        known = ([], []) if training else (tf.cast(self.moving_mean, tf.float32), tf.cast(self.moving_variance, tf.float32))
        y, mean, variance, *_ = tf.raw_ops.FusedBatchNormV3(x=x, scale=scale, offset=offset, mean=known[0], variance=known[1],
                                                            epsilon=self.epsilon, is_training=bool(training))
        if training:
            for kept, now in ((self.moving_mean, mean), (self.moving_variance, variance)):
                kept.assign(kept * self.momentum + tf.cast(now, kept.dtype) * (1 - self.momentum))
        return y


def conv(x, filters, kernel=3, stride=1, name=None):
    x = layers.Conv2D(filters, kernel, stride, padding="same", use_bias=False, name=name)(x)
    x = Norm(momentum=0.98, name=name + "_norm")(x)
    return layers.ReLU(name=name + "_relu")(x)


def up(x, fine, filters, name):
    x = conv(x, filters, 1, name=name + "_lateral")
    shape = fine.shape[1:3]
    x = layers.Resizing(2 * x.shape[1], 2 * x.shape[2], interpolation="nearest", name=name + "_up")(x)
    if x.shape[1] != shape[0] or x.shape[2] != shape[1]:
        x = layers.Cropping2D(((0, x.shape[1] - shape[0]), (0, x.shape[2] - shape[1])), name=name + "_crop")(x)
    return layers.Add(name=name + "_add")([x, fine])


def trunk(image):
    """From the picture to features at an eighth of its size, which know of all of it; and those of the first layer, at a quarter."""
    s4 = conv(image, 16, kernel=6, stride=4, name="stem")
    s8 = conv(s4, 32, stride=2, name="down8")
    s8 = conv(s8, 32, name="block8")
    s16 = conv(s8, 48, stride=2, name="down16")
    s16 = conv(s16, 48, name="block16")
    s32 = conv(s16, 64, stride=2, name="down32")
    s32 = conv(s32, 64, name="block32a")
    s32 = conv(s32, 64, name="block32b")
    s64 = conv(s32, 96, stride=2, name="down64")
    s64 = conv(s64, 96, name="block64")
    x = conv(up(s64, s32, 64, "up32"), 64, name="merge32")
    x = conv(up(x, s16, 48, "up16"), 48, name="merge16")
    return conv(up(x, s8, 32, "up8"), 32, name="merge8"), s4


def build(classes):
    """Input [1, 480, 640, 1] in [-1, 1); output [1, 60, 80, 5 + classes] before activations."""
    image = keras.Input((HEIGHT, WIDTH, 1), batch_size=None, name="image")
    x, _ = trunk(image)
    bias = np.zeros(5 + classes, np.float32)
    bias[4] = -4.0
    head = layers.Conv2D(5 + classes, 1, name=f"head{classes}", bias_initializer=keras.initializers.Constant(bias))(x)
    return keras.Model(image, head, name="fovea_detector")


def boxes_of(output):
    """Corners in input pixels from the raw output grid."""
    gh, gw = HEIGHT // STRIDE, WIDTH // STRIDE
    ys, xs = tf.meshgrid(tf.range(gh, dtype=tf.float32), tf.range(gw, dtype=tf.float32), indexing="ij")
    tx, ty, tw, th = tf.unstack(output[..., :4], axis=-1)
    cx = (xs + tf.sigmoid(tx)) * STRIDE
    cy = (ys + tf.sigmoid(ty)) * STRIDE
    w = tf.exp(tf.clip_by_value(tw, -4.0, 4.0)) * ANCHOR_PX
    h = tf.exp(tf.clip_by_value(th, -4.0, 4.0)) * ANCHOR_PX
    return cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2


def overlap_loss(a, b):
    """1 - distance IoU (Zheng et al. 2020) of corner tuples, and the IoU."""
    iw = tf.maximum(tf.minimum(a[2], b[2]) - tf.maximum(a[0], b[0]), 0.0)
    ih = tf.maximum(tf.minimum(a[3], b[3]) - tf.maximum(a[1], b[1]), 0.0)
    both = iw * ih
    either = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both
    iou = both / tf.maximum(either, 1e-6)
    ow, oh = tf.maximum(a[2], b[2]) - tf.minimum(a[0], b[0]), tf.maximum(a[3], b[3]) - tf.minimum(a[1], b[1])
    dx, dy = (a[0] + a[2] - b[0] - b[2]) / 2, (a[1] + a[3] - b[1] - b[3]) / 2
    return 1 - iou + (dx * dx + dy * dy) / tf.maximum(ow * ow + oh * oh, 1e-6), iou


def loss(target, output):
    """Penalty-reduced focal loss on the centre (Zhou et al. 2019), distance IoU on boxes, cross entropy on classes."""
    heat, weight, positive = target[..., 5], target[..., 6], target[..., 4]
    place, there, kind = tf.split(output, [4, 1, output.shape[-1] - 5], axis=-1)
    p = tf.clip_by_value(tf.sigmoid(there[..., 0]), 1e-5, 1 - 1e-5)
    centre = tf.cast(heat > 0.999, tf.float32)
    focal = -centre * (1 - p) ** 2 * tf.math.log(p) - (1 - centre) * (1 - heat) ** 4 * p ** 2 * tf.math.log(1 - p)
    count = tf.maximum(tf.reduce_sum(centre), 1.0)
    truth = tuple(target[..., k] for k in range(4))
    distance, _ = overlap_loss(boxes_of(place), truth)
    entropy = tf.nn.softmax_cross_entropy_with_logits(target[..., 7:], kind)
    held = 1e-4 * tf.reduce_mean(tf.square(output))  # keeps the range of the quantised output small
    boxes = 2.0 * tf.reduce_sum(distance * positive) + tf.reduce_sum(entropy * positive)
    return (tf.reduce_sum(focal * weight) + boxes) / count + held
