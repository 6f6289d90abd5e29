"""The segmenter: the detector's layers down to features at an eighth of the picture, what the first layer saw at a quarter beside them, and for each of
these cells the scores of its four quarters (Shi et al. 2016), so that the output has a cell for every fourth pixel and its layers are as small as the detector's."""
import keras
import tensorflow as tf
from keras import layers

from augment import HEIGHT, WIDTH
from network import conv, trunk


class Blocks(layers.Layer):
    """Of 2 x 2 pixels one with all their channels (`apart` false), or the opposite."""

    def __init__(self, apart, **more):
        super().__init__(**more)
        self.apart = apart

    def call(self, x):
        return tf.nn.depth_to_space(x, 2) if self.apart else tf.nn.space_to_depth(x, 2)


def build(classes, probabilities=False):
    """Input [1, 480, 640, 1] in [-1, 1); output [1, 120, 160, classes] before SOFTMAX, or after it."""
    image = keras.Input((HEIGHT, WIDTH, 1), batch_size=None, name="image")
    x, s4 = trunk(image)
    fine = conv(Blocks(False, name="quarters")(s4), 32, 1, name="fine8")
    x = layers.Add(name="fine_add")([conv(x, 32, 1, name="fine_lateral"), fine])
    x = conv(x, 48, name="merge_fine")
    x = Blocks(True, name="cells")(layers.Conv2D(4 * classes, 1, name=f"pixels{classes}")(x))
    if probabilities:
        x = layers.Softmax(dtype="float32")(x)
    return keras.Model(image, x, name="fovea_segmenter")


EVEN_CELLS, EVEN_LEAST, EVEN_MOST = 600, 0.5, 3.0


def even_out(here):
    """How much each cell of a label counts, by picture: the more, by the root, the fewer of them it shows; EVEN_CELLS of them count once. So what is far away, and
    shows few, is not lost beside what is near. `here`: [pictures, height, width, 1], 1 where the label is."""
    shown = tf.maximum(tf.reduce_sum(here, (1, 2, 3), keepdims=True), 1.0)
    return tf.clip_by_value(tf.sqrt(EVEN_CELLS / shown), EVEN_LEAST, EVEN_MOST)


def loss_of(weights, of, even=None):
    """Cross entropy, each label by its weight, and one minus the mean over classes of a soft overlap (Rahman and Wang 2016), which is what is judged.
    `of`: the class of each label, of which several may be of one. `even`: a label whose cells are evened out."""
    weights, classes = tf.constant(weights, tf.float32), tf.one_hot(of, int(max(of)) + 1)

    def loss(labels, output):
        marks = tf.one_hot(tf.cast(labels, tf.int32), len(of))  # overlap.NONE: all zeros
        truth, weight = tf.matmul(marks, classes), tf.reduce_sum(marks * weights, -1, keepdims=True)
        if even is not None:
            here = marks[..., even:even + 1]
            weight *= 1 + here * (even_out(here) - 1)
        entropy = -tf.reduce_sum(truth * weight * tf.nn.log_softmax(output), -1)
        known = tf.reduce_sum(truth, -1, keepdims=True)
        share = tf.nn.softmax(output) * known
        both = tf.reduce_sum(truth * share, (0, 1, 2))
        there = tf.reduce_sum(truth, (0, 1, 2))
        overlap = (both + 1.0) / (there + tf.reduce_sum(share, (0, 1, 2)) - both + 1.0)
        present = tf.cast(there > 0, tf.float32)
        missed = 1 - tf.reduce_sum(overlap * present) / tf.maximum(tf.reduce_sum(present), 1.0)
        held = 1e-4 * tf.reduce_mean(tf.square(output))  # keeps the range of the quantised scores small
        return tf.reduce_sum(entropy) / tf.maximum(tf.reduce_sum(weight), 1.0) + 0.5 * missed + held

    return loss
