// What a step says of itself besides the gradients: its loss over all micro-batches and processes, and
// whether the training has failed.
#include <cmath>

#include "models/training/trainer.h"

namespace supertac {

constexpr int kFlatStepsToReport = 100;

void Trainer::Variances::clear() {
  for (BatchVariance* variance : all()) variance->clear();
}

void Trainer::Variances::add(const Variances& other) {
  pictures.add(other.pictures), targets.add(other.targets), means.add(other.means);
}

// Loss terms and variances of micro-batches, then of processes, as balanced binary trees; gradients are added
// in Trainer::apply().
void Trainer::add_up_statistics(StepReport& report) {
  for (std::size_t apart = 1; apart < micro_batches_.size(); apart *= 2) {
    for (std::size_t micro_batch = 0; micro_batch + apart < micro_batches_.size(); micro_batch += 2 * apart) {
      micro_batches_[micro_batch].terms.add(micro_batches_[micro_batch + apart].terms);
      micro_batches_[micro_batch].variances.add(micro_batches_[micro_batch + apart].variances);
    }
  }
  MicroBatch& sum = micro_batches_.front();
  if (ranks_.size() > 1) {
    const auto each = [&](const std::function<void(double&)>& use) {
      for (double* term : sum.terms.all()) use(*term);
      for (BatchVariance* variance : sum.variances.all())
        for (double& value : variance->values()) use(value);
    };
    statistics_.assign(1, report.stop ? 1 : 0);
    each([&](double& value) { statistics_.push_back(value); });
    of_partner_.resize(statistics_.size());
    ranks_.add_up(statistics_, of_partner_);
    report.stop = statistics_[0] > 0;
    std::size_t next = 1;
    each([&](double& value) { value = statistics_[next++]; });
  }
  report.add(sum.terms);
}

void Trainer::check_finite(const LossTerms& t) const {
  if (std::isfinite(t.total)) return;
  std::string where;
  for (const MicroBatch& micro_batch : micro_batches_) {
    if (where.empty()) where = micro_batch.trouble;
  }
  for (const std::string& its : ranks_.gather(where)) {
    where = its;
    if (!where.empty()) break;
  }
  stop(t.text() + (where.empty() ? "" : ": " + where));
}

void Trainer::look_for_collapse(StepReport& report) {
  const Variances& variances = micro_batches_.front().variances;
  if (indices_.size() < 2) return;  // nothing to compare with
  const auto samples = static_cast<double>(indices_.size());
  report.active_latents = active_latents(variances.means, samples);
  const bool idle = objective_.latents() > 0 && report.active_latents == 0;
  const bool flat = idle || is_degenerate(variances.pictures, variances.targets, samples);
  flat_steps_ = flat && step_ >= schedule_.warm_up ? flat_steps_ + 1 : 0;
  report.collapsed = flat_steps_ >= kFlatStepsToReport;
}

}  // namespace supertac
