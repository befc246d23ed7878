// A virtual rig in this process - so that a test can see where the head really is - and the real
// supertac-collect as another one.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/apps/common/process.h"
#include "tests/hardware/virtual_rig/rig_world.h"

namespace supertac {

class CollectRun {
 public:
  /// Five times real time: a machine that stands still for 0.45 s is then a printer that answers none of nine
  /// M114 R, which a run rightly gives up on.
  explicit CollectRun(double speedup = 5, const RigSettings& settings = running());

  ~CollectRun();
  CollectRun(const CollectRun&) = delete;
  CollectRun& operator=(const CollectRun&) = delete;

  static RigSettings running();
  /// Arguments of a collection of one pass over 3_Bumps into out(), with --yes and --quiet, and `more`.
  std::vector<std::string> arguments(const std::vector<std::string>& more = {}) const;
  /// The whole collection, to its end.
  ProcessResult collect(const std::vector<std::string>& more = {}, const ProcessOptions& options = {}) const;

  FaultyPtyRig& rig() { return rig_; }
  Point3 head();
  /// Waits until the head has been in contact for `seconds` of the rig's clock; false when it never is, or
  /// the program that moves it has ended.
  bool wait_for_contact(double seconds, const RunningProcess& program);
  /// Waits until the head stands; the finger of a program that was killed goes on to the end of its move.
  void wait_for_rest();
  double speedup() const { return speedup_; }
  const std::string& out() const { return out_; }
  /// Everything the program may write is below it: out(), and the state that outlives a run.
  const std::string& disk() const { return disk_; }
  /// The mark of a run that was cut off, when there is one.
  bool origin_unknown() const;
  std::string board() const { return folder_ / "board"; }
  std::string printer() const { return folder_ / "printer"; }
  std::string journal() const { return out_ + "/3_Bumps_t1_v10.journal"; }
  /// Names in out(), sorted, one a word.
  std::string files() const;

 private:
  TemporaryFolder folder_;
  double speedup_;
  FaultyPtyRig rig_;
  std::string disk_, out_;  // a real disk where there is one, not the memory of the other temporary folders
};

constexpr double kSlideZ = 91.81;   ///< of the finger in contact
constexpr double kLiftedZ = 96.81;  ///< lowest z of a finger that was lifted

/// True for text of exactly one line.
bool is_one_line(const std::string& text);

}  // namespace supertac
