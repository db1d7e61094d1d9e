// MAC on given pairs, without the files and windows of its program.
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <iostream>

#include "common.h"
using namespace std;
#include "Eva.h"

bool add_overlap = false, low_inlieratio = false, no_logs = true;
static Eigen::Matrix4d shown;

void Corres_Viewer_Score(PointCloudPtr, PointCloudPtr, vector<Corre_3DMatch>&, float&, int) {}
void visualization(PointCloudPtr&, PointCloudPtr&, vector<Corre_3DMatch>&, Eigen::Matrix4d&, float&) {}
void visualization(PointCloudPtr&, PointCloudPtr&, PointCloudPtr&, vector<Corre_3DMatch>&, Eigen::Matrix4d&,
                   Eigen::Matrix4d&, float&) {}
void visualization(PointCloudPtr, PointCloudPtr, Eigen::Matrix4d pose, float) { shown = pose; }
float RMSE_compute(PointCloudPtr, PointCloudPtr, Eigen::Matrix4d&, Eigen::Matrix4d&, float) { return 0; }

int main(int count, char** paths) {
  cout.setstate(ios::failbit);
  return run(count, paths, [](const Pairs& pairs, Eigen::Matrix4d& pose) {
    PointCloudPtr source(new PointCloud), target(new PointCloud);
    vector<Corre_3DMatch> all(pairs.of_model.size());
    for (size_t k = 0; k < all.size(); k++) {
      all[k].src = pcl::PointXYZ(pairs.model(0, k), pairs.model(1, k), pairs.model(2, k));
      all[k].des = pcl::PointXYZ(pairs.cloud(0, k), pairs.cloud(1, k), pairs.cloud(2, k));
      all[k].score = 0;
      all[k].inlier_weight = 0;
    }
    vector<double> overlaps;
    shown.setZero();
    // MAC takes ten times the resolution of the clouds as the bound.
    const bool found = registration(source, target, all, overlaps, ".", pairs.delta / 10, 0.9);
    pose = shown;
    return found && !pose.isZero();
  });
}
