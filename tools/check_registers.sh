#!/bin/sh
# Objects for processors without AVX-512 hold none of its instructions: no 512-bit register, no mask and no register above 15. Their EVEX
# twins, which stand for them on processors with AVX-512 VNNI, have the same width: no 512-bit register. Looks at x86-64 objects alone.
# Usage: tools/check_registers.sh BUILD [OBJDUMP]
set -eu
build=$1
objdump=${2:-objdump}
if ! $objdump -d --no-show-raw-insn "$build/obj/src/kernels/x86/nn_gemm_avx512vnni.o" | grep -q '%zmm[0-9]'; then
    echo "check_registers: found no 512-bit register in nn_gemm_avx512vnni.o, expected some: it sees nothing"
    exit 1
fi
found=0
count=0
for object in "$build"/obj/src/kernels/x86/*.o; do
    case $object in
    *_avx512*.o) continue ;;
    *_evexvnni.o) barred='%zmm[0-9]' ;;
    *) barred='%zmm[0-9]|%k[0-7]|%[xy]mm(1[6-9]|2[0-9]|3[01])' ;;
    esac
    count=$((count + 1))
    if line=$($objdump -d --no-show-raw-insn "$object" | grep -m 1 -E "$barred"); then
        echo "$object: found $line, expected no $barred"
        found=1
    fi
done
[ $found -eq 0 ] && echo "registers: ok, $count objects"
exit $found
