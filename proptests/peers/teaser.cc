#include "graduated.h"

int main(int count, char** paths) {
  return run(count, paths, [](const Pairs& pairs, Eigen::Matrix4d& pose) {
    const auto exact = Teaser::INLIER_SELECTION_MODE::PMC_EXACT;
    return graduated(pairs.model, pairs.cloud, pairs.delta, exact, pose);
  });
}
