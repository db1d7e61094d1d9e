// ROBIN: the maximum clique of its graph, then TEASER++'s solver without its clique.
#include "graduated.h"
#include "robin/robin.hpp"

int main(int count, char** paths) {
  return run(count, paths, [](const Pairs& pairs, Eigen::Matrix4d& pose) {
    auto* graph = robin::Make3dRegInvGraph(pairs.model, pairs.cloud, pairs.delta, robin::GraphsStorageType::ATOMIC_CSR);
    const auto clique = robin::FindInlierStructure(graph, robin::InlierGraphStructure::MAX_CLIQUE);
    delete graph;
    if (clique.size() < 3) return false;
    const auto none = Teaser::INLIER_SELECTION_MODE::NONE;
    return graduated(chosen(pairs.model, clique), chosen(pairs.cloud, clique), pairs.delta, none, pose);
  });
}
