#!/usr/bin/env bash
# The tests with Debian's own python3-dolfinx, in a fresh chroot: sudo tests/on_debian.sh FOLDER [PYTEST ARGUMENTS]
#
# FOLDER is made by debootstrap if it is not there, and takes some 4 GB; it needs root and a suite that has DOLFINx 0.11
# (sid; trixie has 0.9). MIRROR is that of this machine's apt, or the variable's. What is committed is tested.
set -euo pipefail
# Mounts and processes are the script's own: none is left when it ends, however it ends.
[ $$ = 1 ] || exec unshare --mount --pid --fork --kill-child "$BASH" "$0" "$@"
folder=$1
shift
source=$(git -C "$(dirname "$0")" rev-parse --show-toplevel)
mirror=${MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' | grep -v security | head -n 1)}

if ! [ -x "$folder/usr/bin/apt-get" ]; then
    command -v debootstrap >/dev/null || apt-get install -y -qq debootstrap
    debootstrap --variant=minbase sid "$folder" "$mirror"
fi
mount -t proc proc "$folder/proc"
mount --bind /dev "$folder/dev"
mount --bind /sys "$folder/sys"

inside() { chroot "$folder" /usr/bin/env HOME=/root LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"; }

cp /etc/resolv.conf "$folder/etc/resolv.conf"
inside apt-get -o Acquire::Check-Valid-Until=false update -qq
inside apt-get install -y -qq --no-install-recommends python3-dolfinx python3-gmsh python3-pyvista python3-meshio python3-h5py \
    python3-pytest python3-pytest-xdist python3-rich python3-matplotlib python3-hatchling python3-pip mpi-default-bin gcc g++ git

rm -rf "$folder/root/erc_contact"
git clone -q "$source" "$folder/root/erc_contact"
inside pip install --break-system-packages --no-deps --no-build-isolation --no-index /root/erc_contact
# Open MPI runs as root, and more ranks than cores, only if it is told so.
inside OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 PRTE_ALLOW_RUN_AS_ROOT=1 PRTE_ALLOW_RUN_AS_ROOT_CONFIRM=1 \
    PRTE_MCA_mapby=:oversubscribe PYVISTA_OFF_SCREEN=true MPLBACKEND=Agg OMP_NUM_THREADS=1 \
    bash -c 'cd /root/erc_contact && python3 -m erc_contact && python3 -m pytest -p no:cacheprovider "$@"' tests "$@"
