#include "apps/explain/expression.h"

#include <cctype>
#include <map>
#include <stdexcept>
#include <string>

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  Expression parse() {
    while (assignment()) expect(';');
    leaf_name_.clear();
    Variable result = sum();
    if (at() != 0) refuse("+, -, * or the end");
    return {std::move(result), std::move(leaves_)};
  }

 private:
  bool assignment() {
    const std::size_t begin = place_;
    const std::string name = word();
    if (name.empty() || at() != '=') {
      place_ = begin;
      return false;
    }
    ++place_;
    leaf_name_ = name;
    known_[name] = sum();
    return true;
  }

  Variable sum() {
    Variable y = product();
    while (at() == '+' || at() == '-') {
      const bool minus = text_[place_++] == '-';
      const Variable x = product();
      y = minus ? y - x : y + x;
    }
    return y;
  }

  Variable product() {
    Variable y = factor();
    while (at() == '*') {
      ++place_;
      y = y * factor();
    }
    return y;
  }

  Variable factor() {
    if (at() == '(') return in_brackets();
    const std::size_t begin = place_;
    if (const std::string name = word(); !name.empty()) {
      if (name == "relu") return relu(in_brackets());
      if (name == "sigmoid") return sigmoid(in_brackets());
      if (const auto found = known_.find(name); found != known_.end()) return found->second;
      place_ = begin;
      refuse("a number, a name that has one, relu( or sigmoid(");
    }
    return number();
  }

  Variable in_brackets() {
    expect('(');
    Variable y = sum();
    expect(')');
    return y;
  }

  Variable number() {
    std::size_t end = place_ + (at() == '-');
    while (end < text_.size() && (std::isdigit(static_cast<unsigned char>(text_[end])) || text_[end] == '.'))
      ++end;
    const std::string digits(text_.substr(place_, end - place_));
    const auto value = parse_double(digits);
    if (!value)
      refuse(
          "a number, a name that has one, (, relu( or sigmoid(; a minus stands before a number, or between "
          "two parts (0 - a)");
    place_ = end;
    const bool alone = !leaf_name_.empty() && at() == ';';
    leaves_.push_back(
        {alone ? leaf_name_ : digits, Variable(Tensor::full({}, static_cast<real>(*value)), true)});
    return leaves_.back().value;
  }

  std::string word() {
    at();
    std::size_t end = place_;
    while (end < text_.size() && std::isalpha(static_cast<unsigned char>(text_[end]))) ++end;
    const std::string name(text_.substr(place_, end - place_));
    place_ = end;
    return name;
  }

  // The next character that is no space; 0 at the end.
  char at() {
    while (place_ < text_.size() && text_[place_] == ' ') ++place_;
    return place_ < text_.size() ? text_[place_] : '\0';
  }

  void expect(char c) {
    if (at() != c) refuse(std::string(1, c));
    ++place_;
  }

  [[noreturn]] void refuse(const std::string& expected) {
    throw std::invalid_argument("the expression: expected " + expected + " at '" +
                                std::string(text_.substr(place_, 20)) + "'");
  }

  std::string_view text_;
  std::size_t place_ = 0;
  std::string leaf_name_{};
  std::map<std::string, Variable> known_{};
  std::vector<Parameter> leaves_{};
};

}  // namespace

Expression parse_expression(std::string_view text) { return Parser(text).parse(); }

}  // namespace supertac
