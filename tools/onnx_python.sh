#!/bin/sh
# Print the Python that turns ONNX files into .tflite files of real numbers for `tools/import --quantise`, making its environment when it is
# not there. The converter pins TensorFlow as a whole; the smaller package without GPU code is the same to it, so dependencies are listed.
# Usage: tools/onnx_python.sh BUILD; fails where the packages cannot be had.
set -eu
python=${FOVEA_ONNX:-$1/onnx-venv/bin/python}
if [ ! -f "$1/onnx-venv/ready" ] && [ -z "${FOVEA_ONNX:-}" ]; then
    python3 -m venv "$1/onnx-venv"
    "$python" -m pip install -q --no-compile --disable-pip-version-check tensorflow-cpu==2.19.0 numpy==1.26.4 protobuf==4.25.5 h5py==3.11.0 \
        ml-dtypes==0.5.1 flatbuffers==25.12.19 onnx==1.19.1 onnxruntime==1.23.0 ai-edge-litert==2.1.0 psutil==5.9.5 requests==2.32.5 pillow tflite >&2
    "$python" -m pip install -q --no-compile --no-deps --disable-pip-version-check onnx2tf==1.29.24 tf-keras==2.19.0 onnx-graphsurgeon==0.5.8 \
        onnxsim==0.4.36 sng4onnx==2.0.1 opencv-python-headless==4.11.0.86 rich markdown-it-py mdurl pygments >&2
    touch "$1/onnx-venv/ready"
fi
echo "$python"
