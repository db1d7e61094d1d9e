// CLIPPER: its densest consistent set, then least squares.
#include "clipper/clipper.h"
#include "common.h"

int main(int count, char** paths) {
  return run(count, paths, [](const Pairs& pairs, Eigen::Matrix4d& pose) {
    clipper::invariants::EuclideanDistance::Params distance;
    distance.sigma = pairs.delta / 2;
    distance.epsilon = pairs.delta;
    clipper::CLIPPER solver(std::make_shared<clipper::invariants::EuclideanDistance>(distance), clipper::Params());
    solver.setParallelize(false);
    const int points = *std::max_element(pairs.of_model.begin(), pairs.of_model.end()) + 1;
    const int measured = *std::max_element(pairs.of_cloud.begin(), pairs.of_cloud.end()) + 1;
    clipper::invariants::Data model = clipper::invariants::Data::Zero(3, points);
    clipper::invariants::Data cloud = clipper::invariants::Data::Zero(3, measured);
    clipper::Association all(pairs.of_model.size(), 2);
    for (std::size_t k = 0; k < pairs.of_model.size(); k++) {
      model.col(pairs.of_model[k]) = pairs.model.col(k);
      cloud.col(pairs.of_cloud[k]) = pairs.cloud.col(k);
      all.row(k) << pairs.of_model[k], pairs.of_cloud[k];
    }
    solver.scorePairwiseConsistency(model, cloud, all);
    solver.solve();
    const clipper::Association some = solver.getSelectedAssociations();
    if (some.rows() < 3) return false;
    Eigen::Matrix3Xd from(3, some.rows()), to(3, some.rows());
    for (int k = 0; k < some.rows(); k++) {
      from.col(k) = model.col(some(k, 0));
      to.col(k) = cloud.col(some(k, 1));
    }
    pose = Eigen::umeyama(from, to, false);
    return true;
  });
}
