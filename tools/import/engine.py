"""The engine in this process: build/libfovea.a through ctypes, for comparing with the reference interpreter."""
import ctypes
import os
import subprocess

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
MODEL_BYTES = 64  # struct fv_model
DTYPES = [np.uint8, np.int32, np.int64, np.float32]
SETS = {"c": 0, "sse4": 1, "avx2": 2, "avxvnni": 3, "avx512": 4, "neon": 5, "dotprod": 6, "i8mm": 7}


class Error(ctypes.Structure):
    _fields_ = [("status", ctypes.c_int), ("text", ctypes.c_char * 512)]


class Progress(ctypes.Structure):
    _fields_ = [("op", ctypes.c_int32), ("row", ctypes.c_int32)]


def aligned(count):
    raw = np.zeros(count + 64, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start:start + count]


def library():
    """The engine with its internal functions: linked from the archive, since the shared library exports only the public ones."""
    build = os.environ.get("BUILD", os.path.join(ROOT, "build"))
    path = os.environ.get("FOVEA_LIBRARY", os.path.join(build, "libfovea-internal.so"))
    archive = os.path.join(build, "libfovea.a")
    if "FOVEA_LIBRARY" not in os.environ:
        if not os.path.exists(archive):
            raise SystemExit(f"{archive}: not there; `make` builds it")
        if not os.path.exists(path) or os.path.getmtime(path) < os.path.getmtime(archive):
            part = f"{path}.{os.getpid()}"  # several may link it at a time
            subprocess.run([os.environ.get("CXX", "c++"), "-shared", "-o", part, "-Wl,--whole-archive", archive,
                            "-Wl,--no-whole-archive", "-llcm", "-ljpeg", "-pthread"], check=True)
            os.replace(part, path)
    return ctypes.CDLL(path)


class Engine:
    def prepare(self):
        """The table of roundings by real numbers, which is the last member of struct fv_model (src/nn/real.h)."""
        self.lib.fv_nn_real_bytes.restype = ctypes.c_size_t
        count = self.lib.fv_nn_real_bytes(self.model)
        if count == 0:
            return
        self.real = aligned(count)
        ctypes.c_void_p.from_buffer(self.model, MODEL_BYTES - 8).value = self.real.ctypes.data
        self.lib.fv_nn_real_fill(self.model, self.kernels)

    def __init__(self, data, kernel_set=None):
        self.lib = library()
        self.file = aligned(len(data))
        self.file[:] = np.frombuffer(data, np.uint8)
        self.model = ctypes.create_string_buffer(MODEL_BYTES)
        error = Error()
        if self.lib.fv_model_open(ctypes.c_void_p(self.file.ctypes.data), ctypes.c_size_t(len(data)), b"model",
                                  self.model, ctypes.byref(error)) != 0:
            raise RuntimeError(error.text.decode())
        self.kernels = ctypes.create_string_buffer(4096)
        self.lib.fv_kernels_init(self.kernels, SETS[kernel_set or os.environ.get("FOVEA_CPU") or "i8mm"]
                                 if kernel_set or os.environ.get("FOVEA_CPU") else self.best())
        self.prepare()
        self.lib.fv_nn_arena_bytes.restype = ctypes.c_size_t
        self.arena = aligned(self.lib.fv_nn_arena_bytes(self.model))
        self.header = self.file[:512].view(np.uint32)
        self.tensors = self.file[self.header[6]:][:int(self.header[5]) * 64].view(np.int32).reshape(-1, 16)
        self.ops = self.file[self.header[8]:][:int(self.header[7]) * 256].view(np.int32).reshape(-1, 64)
        self.inputs = self.file[self.header[10]:][:int(self.header[9]) * 4].view(np.int32)
        self.outputs = self.file[self.header[12]:][:int(self.header[11]) * 4].view(np.int32)

    def best(self):
        best = ctypes.c_int()
        self.lib.fv_cpu_parse(None, ctypes.byref(best), None)
        return best.value

    def tensor(self, index):
        """A tensor's elements as an array in the file's original form."""
        t = self.tensors[index]
        base = self.file if t[1] & 1 else self.arena
        shape = tuple(t[3:3 + t[2]])
        dtype = DTYPES[t[0]]
        if t[0] == 0:
            strides, step = [], int(t[15])
            for n in reversed(shape[:-1]):
                strides.append(step)
                step *= int(n)
            view = np.lib.stride_tricks.as_strided(base[t[10]:], shape, (*reversed(strides), 1) if shape else ())
            return (view ^ 128).view(np.int8) if t[1] & 2 else view.copy()
        return base[t[10]:t[10] + t[9]].view(dtype).reshape(shape).copy()

    def set_input(self, number, array):
        t = self.tensors[self.inputs[number]]
        raw = np.ascontiguousarray(array)
        if t[0] == 0 and t[1] & 2:
            raw = raw.view(np.uint8) ^ 128
        raw = np.frombuffer(raw.tobytes(), np.uint8)
        assert len(raw) == t[9], (len(raw), t[9])
        self.arena[t[10]:t[10] + t[9]] = raw

    def run(self, units=1 << 30, progress=None):
        progress = progress or Progress(0, 0)
        done = ctypes.c_uint32()
        status = self.lib.fv_nn_run(self.model, self.kernels, ctypes.c_void_p(self.arena.ctypes.data),
                                    ctypes.byref(progress), ctypes.c_uint32(units), ctypes.byref(done))
        return status, progress

    def caller(self):
        """What runs the whole network, with nothing left to prepare: to be timed."""
        progress, done = Progress(0, 0), ctypes.c_uint32()
        run = self.lib.fv_nn_run
        arguments = (ctypes.byref(self.model), ctypes.byref(self.kernels), ctypes.c_void_p(self.arena.ctypes.data),
                     ctypes.byref(progress), ctypes.c_uint32(1 << 30), ctypes.byref(done))

        def call():
            progress.op = progress.row = 0
            run(*arguments)
        return call

    def run_op(self, progress):
        """Finish the operator that `progress` stands at."""
        op = progress.op
        while progress.op == op:
            self.run(1, progress)
