// KISS-Matcher on given pairs: the maximum core of ROBIN's graph, then its own solver with three quarters of the bound.
#include "common.h"
#include "kiss_matcher/GncSolver.hpp"
#include "robin/robin.hpp"

int main(int count, char** paths) {
  return run(count, paths, [](const Pairs& pairs, Eigen::Matrix4d& pose) {
    auto* graph = robin::Make3dRegInvGraph(pairs.model, pairs.cloud, pairs.delta);
    const auto core = robin::FindInlierStructure(graph, robin::InlierGraphStructure::MAX_CORE);
    delete graph;
    if (core.size() < 3) return false;
    kiss_matcher::RobustRegistrationSolver::Params params;
    params.noise_bound = 0.75 * pairs.delta;
    kiss_matcher::RobustRegistrationSolver solver(params);
    solver.solve(chosen(pairs.model, core), chosen(pairs.cloud, core));
    const auto found = solver.getSolution();
    pose.topLeftCorner<3, 3>() = found.rotation;
    pose.topRightCorner<3, 1>() = found.translation;
    return found.valid && solver.getTranslationInliers().size() >= 3;
  });
}
