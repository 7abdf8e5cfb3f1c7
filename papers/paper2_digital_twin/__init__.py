"""Paper 2: a digital twin that is updated, diagnosis by how much fault data there is, degradation curves.

contact dynamics --> live twin --> records of every fault --> SOM-MQE | SVM | network, by what is labelled --> diagnosis
                                                                          run to failure --> indicator --> curves

Used in: Paper 2, a bearing fault diagnosis framework based on a digital twin (its text gives no table and loses its
equations; what is printed here is ours, beside the paper's statement that it tests).
"""
