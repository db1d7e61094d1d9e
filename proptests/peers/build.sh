#!/bin/sh
# build.sh SOURCES OUT: builds the drivers from clones in SOURCES: teaser, pmc, robin, xenium, atomic_queue, clipper, mac, and kiss (the
# folder with kiss_matcher/). Needs Eigen, and for MAC PCL 1.13 and igraph; a driver that does not build is reported and skipped.
set -u
here=$(cd "$(dirname "$0")" && pwd) from=$(cd "$1" && pwd)
mkdir -p "$2/parts" && cd "$2/parts" || exit 1
flags="-O3 -march=native -fopenmp -w -DNDEBUG -std=c++17 -I/usr/include/eigen3 -I$here"
flags="$flags -I$from/pmc/include -I$from/teaser/teaser/include -I$from/robin/include -I$from/xenium -I$from/atomic_queue/include"
flags="$flags -I$from/clipper/include -I$from/kiss"
objects() { # FOLDER SOURCE…
  mkdir -p "$1" && cd "$1" && shift && g++ $flags -c "$@"; cd - >/dev/null
}
driver() { # NAME ARGUMENT…
  name=$1 && shift
  g++ $flags "$here/$name.cc" "$@" -o "../$name" || echo "$name: not built" >&2
}
objects pmc $(ls "$from"/pmc/pmc*.cpp | grep -v 'driver\|lib')
objects teaser "$from"/teaser/teaser/src/graph.cc "$from"/teaser/teaser/src/registration.cc
mkdir -p robins # one thread
sed 's/in.threads = 12/in.threads = 1/' "$from/robin/src/graph_solvers.cpp" >robins/graph_solvers.cpp
objects robin $(ls "$from"/robin/src/*.cpp | grep -v 'graph_solvers') "$PWD/robins/graph_solvers.cpp"
objects clipper "$from"/clipper/src/clipper.cpp "$from"/clipper/src/dsd.cpp "$from"/clipper/src/utils.cpp \
  "$from"/clipper/src/sdp.cpp "$from"/clipper/src/maxclique.cpp "$from"/clipper/src/invariants/euclidean_distance.cpp
objects kiss "$from"/kiss/kiss_matcher/GncSolver.cpp
driver teaser teaser/*.o pmc/*.o
driver robin robin/*.o teaser/*.o pmc/*.o
driver clipper clipper/*.o
driver kiss kiss/*.o robin/*.o pmc/*.o
# One thread, no windows, no files.
mkdir -p macs
cp "$from"/mac/Linux/Eva.h macs/
for part in PCR funcs registration; do
  sed -e '/pcl_visualizer.h/d; /savetxt(.*folderPath/d; s/ofstream outfile(save_est, ios::trunc)/ofstream outfile/' \
    -e 's/setNbThreads(6)/setNbThreads(1)/; s/omp_set_num_threads(12)/omp_set_num_threads(1)/' \
    "$from/mac/Linux/$part.cpp" >macs/$part.cpp
done
flags="$flags -I/usr/include/pcl-1.13 -I/usr/include/igraph -I$PWD/macs -include boost/random.hpp -include iomanip"
objects mac "$PWD"/macs/*.cpp
driver mac mac/*.o -lpcl_common -lpcl_kdtree -lpcl_search -lpcl_io -lpcl_io_ply -lpcl_features -lpcl_filters -lpcl_surface \
  -lpcl_octree -lflann_cpp -llz4 -ligraph
