#!/bin/bash
# Boot the virtual machine made by tools/hil/setup.sh and run tests/hil/guest.sh in it. The host's root file system is shared
# read-only, so that the machine runs the programs just built, at the same paths; RESULTS is shared for writing. The exit
# status is that of the guest; 200 when the machine did not come to an end of its own.
# With HIL_ROOT=FOLDER the root file system is that folder, under a layer in memory, and its systemd is the first process: what is
# to be run starts as a service there, finds RESULTS at /results, and ends the machine by a byte to I/O port 0xf4.
# Usage: tools/hil/vm.sh FOLDER RESULTS SECONDS [SCRIPT]
set -u
here=$(cd "$(dirname "$0")/../.." && pwd)
dir=$(cd "$1" && pwd)
mkdir -p "$2"
results=$(cd "$2" && pwd)
# What costs an emulator most is left out: a second processor (starting a program then takes four times as much of the host's; HIL_CPUS=2
# has it, for races), a fifth level of page tables, access checks switched on and off around each copy from user space,
# reading the time from a device.
# Emulated unless HIL_ACCEL=kvm: that a machine has /dev/kvm does not mean that it works.
acceleration=${HIL_ACCEL:-tcg}
# The machine's clock counts its instructions, 8 ns each, and goes on by itself only while it is idle: what else runs on the host makes
# it no slower in its own time, so the suite may judge how long a camera takes to come back.
counted=
[ $acceleration = tcg ] && [ "${HIL_CPUS:-1}" = 1 ] && counted='-icount shift=3,sleep=on'
timeout -k 5 "$3" qemu-system-x86_64 -nodefaults -no-user-config -display none -no-reboot -machine q35 \
    -accel $acceleration $counted -cpu max,la57=off,smap=off,smep=off,umip=off -smp "${HIL_CPUS:-1}" -m 1536 \
    -kernel "$dir/vmlinux" -initrd "$dir/initrd.gz" -serial stdio \
    -append "console=ttyS0 quiet loglevel=4 panic=-1 mitigations=off nopti init_on_alloc=0 no_timer_check nokaslr oops=panic \
tsc=reliable clocksource=tsc hil.dir=$dir hil.project=$here hil.results=$results hil.script=${4:-} hil.root=${HIL_ROOT:-} HIL_PARTS=${HIL_PARTS:-} HIL_UNPLUGS=${HIL_UNPLUGS:-}" \
    -device isa-debug-exit,iobase=0xf4,iosize=1 \
    -virtfs local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap \
    -virtfs "local,path=$results,mount_tag=results,security_model=none,multidevs=remap" </dev/null
status=$?
# isa-debug-exit turns a status S into 2 S + 1.
if [ $((status & 1)) -eq 1 ] && [ $status -lt 124 ]; then exit $(((status - 1) / 2)); fi
echo "hil: the machine ended with $status" >&2
exit 200
