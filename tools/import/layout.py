"""The numbers of src/nn/model.h, in Python. Every parameter is one 32-bit word; lists give their order."""
VERSION = 5                  # of files with operators in parts
VERSION_SLOPES = 4           # of other files with slopes (BINARY)
VERSION_STATES = 3           # of other files with states
VERSION_STATELESS = 2        # of other files without states
MAGIC = b"FVM\x01"
ALIGN = 64
HEADER_BYTES = 512
TENSOR_WORDS, OP_WORDS, PARAM_WORDS = 16, 64, 48
REDUCE_LANES = 64          # results that are reduced together
CONV_PIXELS = 48           # output pixels gathered at a time
DEPTHWISE_COLUMNS = 72     # input columns interleaved at a time
UNIT_COST = 4000000        # of a unit, in sixteenths of a nanosecond (FV_NN_UNIT_COST)
ARENA_SLACK = 64           # bytes that kernels may read past the last tensor

TYPES = {"UINT8": 0, "INT8": 0, "BOOL": 0, "INT32": 1, "INT64": 2, "FLOAT32": 3}
TYPE_BYTES = {"UINT8": 1, "INT8": 1, "BOOL": 1, "INT32": 4, "INT64": 8, "FLOAT32": 4}
FLAG_CONST, FLAG_SIGNED = 1, 2

KINDS = ["NONE", "CONV", "DEPTHWISE", "BINARY", "POOL", "REDUCE", "COPY", "FILL", "RESIZE", "SOFTMAX", "ARG_MAX",
         "DEQUANTIZE", "QUANTIZE", "CAST", "BATCH_MATMUL", "DETECTION", "NORMALISE"]
KIND = {name: i for i, name in enumerate(KINDS)}
BINARY = {"ADD": 0, "SUB": 1, "MUL": 2, "MAXIMUM": 3, "MINIMUM": 4, "PRELU": 5, "DIV": 6, "SLOPES": 7}


def _six(name):
    return [f"{name}{i}" for i in range(6)]


def _four(name):
    return [f"{name}{i}" for i in range(4)]


_IMAGE = ["batch", "in_h", "in_w", "in_c", "in_stride", "out_h", "out_w", "out_c", "out_stride"]
_WINDOW = ["kh", "kw", "stride_y", "stride_x", "dilation_y", "dilation_x", "pad_top", "pad_left"]
PARAMS = {
    "CONV": _IMAGE + _WINDOW + ["k", "k4", "zero_in", "zero_out", "act_min", "act_max", "row_sum_factor",
                                "single_rounding", "weights", "bias", "multiplier", "shift", "table", "out_first",
                                "out_row", "parts"],
    "DEPTHWISE": _IMAGE + _WINDOW + ["zero_in", "zero_out", "act_min", "act_max", "planes", "c16", "weights", "bias",
                                     "multiplier", "shift", "table"],
    "BINARY": ["function"] + _six("dim") + _six("a") + _six("b") + _six("o") +
              ["zero_a", "zero_b", "zero_out", "m_a", "s_a", "m_b", "s_b", "m_out", "s_out", "act_min", "act_max",
               "table"],
    "POOL": _IMAGE + _WINDOW + ["average", "is_signed", "act_min", "act_max", "parts"],
    "REDUCE": ["function"] + _four("dim") + _four("outer") + _four("count") + _four("inner") +
              ["elements", "multiplier", "shift", "zero_in", "zero_out", "parts"],
    "COPY": _six("dim") + _six("src") + _six("dst") + ["src_first", "dst_first", "element_bytes", "table"],
    "FILL": ["bytes", "value"],
    "RESIZE": _IMAGE + ["mode", "rows_table", "columns_table", "bits"],
    "SOFTMAX": ["outer", "depth", "table"],
    "ARG_MAX": ["outer", "axis", "inner", "element_bytes", "minimum"],
    "DEQUANTIZE": ["count", "table"],
    "QUANTIZE": ["count", "scale", "zero"],
    "CAST": ["count"],
    "BATCH_MATMUL": ["batch0", "batch1", "a_batch0", "a_batch1", "b_batch0", "b_batch1", "m", "k", "n", "a_row",
                     "b_row", "b_column", "zero_a", "zero_b", "zero_out", "multiplier", "shift", "single_rounding", "bias",
                     "pack", "parts"],
    "DETECTION": ["anchors", "classes", "class_offset", "max_detections", "max_per_anchor", "per_class",
                  "regular_nms", "score_threshold", "iou_threshold", "y_scale", "x_scale", "h_scale", "w_scale",
                  "anchor_data", "box_table", "score_table", "parts"],
    "NORMALISE": ["outer", "depth", "zero_in", "is_signed"],
}
